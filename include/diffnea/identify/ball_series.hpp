#pragma once
/// The ball's path as the camera saw it and as two models have it: what pictures are made of. Plain
/// data, row by row of the rows at which the ball was seen.

#include <array>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>

namespace diffnea {

/// Rows or flights that cannot be true, and why. They are left out, but for rows beyond the
/// string's reach, which are named alone.
struct BallFlag {
  int run = 0;
  double time = 0.0;
  std::string channel;
  std::string reason;

  template <class List>
  static constexpr void fields(List& list) {
    list.type(
        "BallFlag",
        "A row or flight that cannot be true; left out, but for rows beyond the string's reach.");
    list.field("run", &BallFlag::run, "Number of the recording.");
    list.field("time", &BallFlag::time, "When; of a flight: where it begins.", {.unit = "s"});
    list.field("channel", &BallFlag::channel, "``ball`` or ``spin``.");
    list.field("reason", &BallFlag::reason, "Why, a sentence with numbers.");
  }
};

/// A ball as it was seen, and as models before and after the fit move it, row by row.
struct BallSeries {
  using Point = std::array<double, 3>;  ///< [m], W; NaN: none

  bool held_out = false;
  bool has_string = false;
  std::vector<int> run;
  std::vector<int> window;
  std::vector<double> time;
  std::vector<Point> measured;
  std::vector<Point> base;
  std::vector<Point> extended;
  std::vector<Point> anchor;
  std::vector<bool> taut;
  double length = 0.0;
  double sigma = 0.0;
  double base_rms = 0.0;
  double extended_rms = 0.0;
  std::vector<BallFlag> flagged;

  /// Number of rows.
  long rows() const { return static_cast<long>(time.size()); }

  template <class List>
  static constexpr void fields(List& list) {
    list.type("BallSeries",
              "The ball's path as the camera saw it and as two models have it, row by row of those "
              "at which it was seen. Positions in the world [m].",
              {.files = kInResult});
    list.field("held_out", &BallSeries::held_out,
               "Of the test recordings, else of those that were fitted.");
    list.field("has_string", &BallSeries::has_string,
               "False: it flies freely; no anchor, length 0.");
    list.in_memory("run", &BallSeries::run, "(M,) recording of each row, integers.");
    list.in_memory("window", &BallSeries::window,
                   "(M,) integers; each window starts from an estimated state of its own.");
    list.in_memory("time", &BallSeries::time, "(M,) of the recording.", {.unit = "s"});
    list.in_memory("measured", &BallSeries::measured,
                   "(M, 3) as the camera saw it; NaN: not seen.");
    list.in_memory("base", &BallSeries::base,
                   "(M, 3) of the model before the fit, or without the causes.");
    list.in_memory("extended", &BallSeries::extended,
                   "(M, 3) of the model as fitted, or with the causes.");
    list.in_memory("anchor", &BallSeries::anchor,
                   "Where the string is tied (of the extended model).");
    list.in_memory("taut", &BallSeries::taut,
                   "(M,) booleans: the string is taut in the extended model.");
    list.field("length", &BallSeries::length, "Of the extended model's string.",
               {.unit = "m", .empty_is_null = true});
    list.field("sigma", &BallSeries::sigma,
               "Noise of one position along one axis [m]: the camera's, as its rows tell it "
               "whatever the model; where they are too few, what the fit leaves.");
    list.field("base_rms", &BallSeries::base_rms,
               "Error of ``base``, of one position along one axis.", {.unit = "m"});
    list.field("extended_rms", &BallSeries::extended_rms, "The same of the extended model.",
               {.unit = "m"});
    list.field("flagged", &BallSeries::flagged,
               "Rows and flights that cannot be true, a list of :class:`BallFlag`.");
  }
};

}  // namespace diffnea
