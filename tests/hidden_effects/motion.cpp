#include "motion.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace hidden {
namespace {

// What an arm does without shaking; a carriage moves a tenth of that.
constexpr double kMaxVelocity = 2.5;       // [rad/s]
constexpr double kMaxAcceleration = 30.0;  // [rad/s²]
constexpr double kSlide = 0.2;             // [m/rad]

// Of a harmonic's frequency, where the motion is not to repeat; periods over which its peaks count.
constexpr double kDetuned = 0.4;
constexpr int kManyPeriods = 20;

}  // namespace

Motion::Motion(const Robot& robot, double period, Rng rng, bool repeats) : period_(period) {
  const int periods = repeats ? 1 : kManyPeriods;
  for (int j = 0; j < robot.num_joints(); ++j) {
    const Link& link = robot.links[static_cast<std::size_t>(j)];
    Series s;
    for (int h = 0; h < kHarmonics; ++h) {
      s.a[h] = rng.normal() / std::sqrt(h + 1.0);
      s.b[h] = rng.normal() / std::sqrt(h + 1.0);
      s.f[h] = h + 1.0 + (repeats ? 0.0 : rng.uniform(-kDetuned, kDetuned));
    }
    joints_.push_back(s);
    const double unit = link.slide ? kSlide : 1.0;
    const double scale =
        rng.uniform(0.75, 1.0) *
        std::min({link.range / peak(j, 0, periods), unit * kMaxVelocity / peak(j, 1, periods),
                  unit * kMaxAcceleration / peak(j, 2, periods)});
    Series& drawn = joints_.back();
    for (double* coefficient : {drawn.a, drawn.b})
      for (int h = 0; h < kHarmonics; ++h) coefficient[h] *= scale;
    drawn.centre = link.centre;
  }
}

Motion::Motion(const Robot& robot, double period, const std::filesystem::path& file)
    : period_(period), rows_(3 * robot.links.size()) {
  std::ifstream in(file);
  std::string line, cell;
  std::getline(in, line);
  std::vector<std::vector<double>*> column;
  std::vector<double> time;
  std::stringstream head(line);
  while (std::getline(head, cell, ',')) {
    column.push_back(cell == "time" ? &time : nullptr);
    for (std::size_t j = 0; j < robot.links.size(); ++j)
      for (std::size_t d = 0; d < 3; ++d)
        if (cell == std::string("q") + std::string(d, 'd') + "cmd_" + robot.links[j].joint)
          column.back() = &rows_[3 * j + d];
  }
  while (std::getline(in, line)) {
    std::stringstream cells(line);
    for (std::vector<double>* to : column)
      if (std::getline(cells, cell, ',') && to) to->push_back(std::stod(cell));
  }
  for (const std::vector<double>& values : rows_)
    if (values.size() != time.size() || time.size() < 2)
      throw std::invalid_argument(file.string() +
                                  ": no trajectory of every joint (time, qcmd_, qdcmd_, qddcmd_)");
  step_ = (time.back() - time.front()) / static_cast<double>(time.size() - 1);
}

double Motion::at_time(int joint, double time, int derivative) const {
  const std::vector<double>& x = rows_[static_cast<std::size_t>(3 * joint + derivative)];
  const double n = static_cast<double>(x.size() - 1);  // the last row is the first again
  double at = std::fmod(time / step_, n);
  if (at < 0.0) at += n;
  const std::size_t i = std::min(static_cast<std::size_t>(at), x.size() - 2);
  return x[i] + (at - static_cast<double>(i)) * (x[i + 1] - x[i]);
}

double Motion::sum(int joint, double time, int derivative) const {
  if (!rows_.empty()) return at_time(joint, time, derivative);
  const Series& s = joints_[static_cast<std::size_t>(joint)];
  double out = derivative == 0 ? s.centre : 0.0;
  for (int h = 0; h < kHarmonics; ++h) {
    const double w = 2.0 * std::numbers::pi * s.f[h] / period_;
    const double sine = std::sin(w * time), cosine = std::cos(w * time);
    if (derivative == 0) out += s.a[h] * sine + s.b[h] * cosine;
    if (derivative == 1) out += w * (s.a[h] * cosine - s.b[h] * sine);
    if (derivative == 2) out -= w * w * (s.a[h] * sine + s.b[h] * cosine);
  }
  return out;
}

double Motion::peak(int joint, int derivative, int periods) const {
  double largest = 0.0;
  for (int i = 0; i < 400 * periods; ++i)
    largest = std::max(largest, std::abs(sum(joint, period_ * i / 400.0, derivative)));
  return largest;
}

}  // namespace hidden
