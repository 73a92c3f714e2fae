#pragma once
/// Numbers with a point, whatever the program's locale. Internal.
///
/// A program that calls setlocale(LC_NUMERIC, …), as toolkits of windows do, turns the point of
/// printf's numbers into a comma: text that is drawn from (SVG, JSON within pages) or read again
/// must not change with it.

#include <cstdarg>
#include <cstddef>
#include <cstdio>
#include <locale.h>

namespace diffnea::detail {

/// While it lives, this thread's numbers have a point.
class CNumbers {
 public:
  CNumbers() : before_(uselocale(c_locale())) {}
  ~CNumbers() { uselocale(before_); }
  CNumbers(const CNumbers&) = delete;
  CNumbers& operator=(const CNumbers&) = delete;

 private:
  static locale_t c_locale() {
    static const locale_t locale = newlocale(LC_ALL_MASK, "C", locale_t{});
    return locale;
  }
  locale_t before_;
};

/// std::snprintf with a point in its numbers.
#ifdef __GNUC__
[[gnu::format(printf, 3, 4)]]
#endif
inline int print(char* out, std::size_t size, const char* format, ...) {
  const CNumbers point;
  std::va_list arguments;
  va_start(arguments, format);
  const int length = std::vsnprintf(out, size, format, arguments);
  va_end(arguments);
  return length;
}

}  // namespace diffnea::detail
