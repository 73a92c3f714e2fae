#pragma once
/// Desired motions: sums of sines, another one for every stream of a seed.

#include <filesystem>
#include <vector>

#include "random.hpp"
#include "robot.hpp"

namespace hidden {

/// q(t) = centre + Σ_h a_h sin(2πf_h t/T) + b_h cos(2πf_h t/T), one series per joint.
class Motion {
 public:
  /// Amplitudes fill the joints' ranges as far as speed and acceleration allow.
  /// @param period   T [s]
  /// @param repeats  f_h = h; else they are drawn about it, and the motion never repeats
  Motion(const Robot& robot, double period, Rng rng, bool repeats = true);
  /// A motion from a file: `time` at equal steps, qcmd_, qdcmd_, qddcmd_ of every joint, over one
  /// period or several; the last row is the first again.
  /// @throws std::invalid_argument if a column is missing
  Motion(const Robot& robot, double period, const std::filesystem::path& file);

  double period() const { return period_; }
  double position(int joint, double time) const { return sum(joint, time, 0); }
  double velocity(int joint, double time) const { return sum(joint, time, 1); }
  double acceleration(int joint, double time) const { return sum(joint, time, 2); }

 private:
  static constexpr int kHarmonics = 5;
  struct Series {
    double centre = 0.0;
    double a[kHarmonics] = {}, b[kHarmonics] = {}, f[kHarmonics] = {};
  };
  double sum(int joint, double time, int derivative) const;
  double peak(int joint, int derivative, int periods) const;

  double at_time(int joint, double time, int derivative) const;

  double period_;
  std::vector<Series> joints_;
  double step_ = 0.0;                        ///< of the rows [s]
  std::vector<std::vector<double>> rows_{};  ///< [derivative + 3 joint]; empty: a series
};

}  // namespace hidden
