#pragma once
/// Errors that a caller can mend. Every message reads `where: what came, what was expected (why);
/// choices`. A numerical outcome (not converged, not identifiable) is data, never an exception.

#include <stdexcept>
#include <string>

namespace diffnea {

/// Base of everything the library throws on purpose.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An array has the wrong length or shape.
class ShapeError : public Error {
 public:
  using Error::Error;
};

/// A robot description, or the effects on it, cannot be true or cannot be read.
class ModelError : public Error {
 public:
  using Error::Error;
};

/// A recording cannot be true, cannot be read, or does not suit the model.
class DataError : public Error {
 public:
  using Error::Error;
};

/// A file or folder cannot be read or written.
class FileError : public Error {
 public:
  using Error::Error;
};

/// @throws ShapeError `where: got N values, expected M (one per what)` if `got != expected`.
inline void require_size(const char* where, long got, long expected, const char* what) {
  if (got == expected) return;
  throw ShapeError(std::string(where) + ": got " + std::to_string(got) + " values, expected " +
                   std::to_string(expected) + " (one per " + what + ")");
}

}  // namespace diffnea
