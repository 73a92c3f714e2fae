#include "sensors.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <stdexcept>

namespace hidden {
namespace {

double quantised(double x, double step) { return step > 0.0 ? step * std::round(x / step) : x; }

/// Position at a fractional row, by the cubic that has the velocities at both ends.
double position_at(const Series& s, double row, Eigen::Index j) {
  const auto i = static_cast<Eigen::Index>(std::floor(row));
  const double u = row - static_cast<double>(i), h = s.time[1] - s.time[0];
  const double a = s.q(i, j), b = s.q(i + 1, j), da = h * s.qd(i, j), db = h * s.qd(i + 1, j);
  return a + u * (da + u * (3.0 * (b - a) - 2.0 * da - db + u * (2.0 * (a - b) + da + db)));
}

void add(std::string& line, double x) {
  char text[32];
  std::snprintf(text, sizeof text, ",%.9g", x);
  line += text;
}

}  // namespace

Eigen::MatrixXd draw_position_noise(const Case& c, Rng& rng) {
  const Eigen::Index rows = std::lround(c.duration * c.rate) + 2 * kPad;
  Eigen::MatrixXd out(rows, c.sensors.position_noise.size());
  for (Eigen::Index k = 0; k < out.rows(); ++k)
    for (Eigen::Index j = 0; j < out.cols(); ++j)
      out(k, j) = c.sensors.position_noise[j] * rng.normal();
  return out;
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

void write_recording(const std::filesystem::path& stem, const Case& c, const Series& s,
                     const Eigen::MatrixXd& position_noise, const Eigen::VectorXd& torque_rms,
                     Rng& rng) {
  const Robot& robot = c.world.robot;
  const int n = robot.num_joints();
  double delay = 0.0;
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(n), offset = Eigen::VectorXd::Zero(n),
                  velocity_lag = Eigen::VectorXd::Zero(n);
  for (const Mechanism& h : c.world.hidden) {
    if (h.position_delay) delay += h.position_delay(h.strength);
    for (int j = 0; j < n; ++j) {
      if (h.velocity_lag) velocity_lag[j] += h.velocity_lag(h.strength, j);
      if (!h.encoder) continue;
      const Encoder e = h.encoder(h.strength, j);
      scale[j] *= e.scale;
      offset[j] += e.offset;
    }
  }
  const double colour =
      c.sensors.corner > 0.0 ? std::exp(-2.0 * std::numbers::pi * c.sensors.corner / c.rate) : 0.0;

  std::string text = "time";
  for (const char* channel : {"q_", "tau_", "qcmd_", "qd_"})
    for (const Link& link : robot.links)
      if (channel != std::string("qd_") || c.sensors.velocities)
        text += "," + (channel + link.joint);
  text += "\n";
  Eigen::VectorXd noise(n), velocity = s.qd.row(0);
  for (int j = 0; j < n; ++j) noise[j] = rng.normal();
  for (Eigen::Index k = 0; k < s.time.size(); ++k) {
    // A first-order filter as a drive computes it, once a sample.
    for (int j = 0; j < n; ++j) {
      const double keep = velocity_lag[j] > 0.0 ? std::exp(-1.0 / (c.rate * velocity_lag[j])) : 0.0;
      velocity[j] = keep * velocity[j] + (1.0 - keep) * scale[j] * s.qd(k, j);
      noise[j] = colour * noise[j] + std::sqrt(1.0 - colour * colour) * rng.normal();
    }
    if (k < kPad || k >= s.time.size() - kPad) continue;
    char time[32];
    std::snprintf(time, sizeof time, "%.6f", s.time[k]);
    text += time;
    for (int j = 0; j < n; ++j) {
      const double q =
          delay == 0.0 ? s.q(k, j) : position_at(s, static_cast<double>(k) - delay * c.rate, j);
      add(text,
          quantised(scale[j] * q + offset[j] + position_noise(k, j), c.sensors.position_step[j]));
    }
    for (int j = 0; j < n; ++j) {
      const double deviation = c.sensors.torque_noise * torque_rms[j];
      add(text, quantised(s.tau(k, j) + deviation * noise[j], c.sensors.torque_step * deviation));
    }
    for (int j = 0; j < n; ++j) add(text, s.qcmd(k, j));
    for (int j = 0; c.sensors.velocities && j < n; ++j) {
      const double deviation = 20.0 * c.sensors.position_noise[j];
      add(text, velocity[j] + deviation * rng.normal());
    }
    text += "\n";
  }
  write_text(stem.string() + ".csv", text);
  Json sidecar{
      {"schema", "diffnea/recording/1"}, {"torque_side", "motor"}, {"torque_sampling", "hold"}};
  if (c.repeats) sidecar["period"] = c.period;
  write_text(stem.string() + ".json", sidecar.dump(1) + "\n");
}

}  // namespace hidden
