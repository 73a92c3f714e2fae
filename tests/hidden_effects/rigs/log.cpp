#include "log.hpp"

#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <stdexcept>

namespace rigs {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

double rounded(double x, double step) { return step > 0.0 ? step * std::round(x / step) : x; }

void append(std::string& out, double x) {
  char cell[40];
  const int length = std::snprintf(cell, sizeof cell, ",%.8g", x);
  out.append(cell, static_cast<std::size_t>(length));
}

}  // namespace

void write_text(const std::filesystem::path& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

void write_log(const std::filesystem::path& stem, const Case& c, const Recording& recording,
               const VectorXd& torque_rms, bool is_test) {
  const Arm& arm = c.rig.arm;
  const Sensors& s = c.sensors;
  const Index n = arm.size();
  const bool many = recording.tracks.size() > 1, currents = s.constant.size() > 0;
  double lag = 0.0;
  Index lag_joint = -1;
  for (const Effect& e : c.effects)
    if (e.velocity_lag > 0.0) lag = e.velocity_lag, lag_joint = e.late_joint;
  std::string text = "time";
  if (many) text += ",run";
  for (const Joint& joint : arm.joints) text += ",q_" + joint.name;
  for (const Joint& joint : arm.joints)
    text += ",tau_" + joint.name + (currents && !joint.passive ? " [A]" : "");
  for (const Joint& joint : arm.joints)
    if (s.commands) text += ",qcmd_" + joint.name;
  for (const Joint& joint : arm.joints)
    if (s.velocities) text += ",qd_" + joint.name;
  text += "\n";

  Draw draw(c.seed, c.stream + (is_test ? 13 : 12));
  const double colour =
      s.corner > 0.0 ? std::exp(-2.0 * std::numbers::pi * s.corner / c.rate) : 0.0;
  const double keep = lag > 0.0 ? std::exp(-1.0 / (c.rate * lag)) : 0.0;
  VectorXd noise(n), q(n), tau(n), filtered;
  for (Index j = 0; j < n; ++j) noise[j] = draw.normal();
  for (std::size_t r = 0; r < recording.tracks.size(); ++r) {
    const Track& track = recording.tracks[r];
    filtered = track.qd.row(0);
    for (Index k = 0; k < track.q.rows(); ++k) {
      char time[40];
      std::snprintf(time, sizeof time, "%.6f",
                    recording.samplings[r].times[static_cast<std::size_t>(k)]);
      text += time;
      if (many) text += "," + std::to_string(r);
      for (Index j = 0; j < n; ++j) {
        noise[j] = colour * noise[j] + std::sqrt(1.0 - colour * colour) * draw.normal();
        filtered[j] =
            j == lag_joint ? keep * filtered[j] + (1.0 - keep) * track.qd(k, j) : track.qd(k, j);
        const double position = track.q(k, j) + s.position_noise[j] * draw.normal();
        if (k % s.slow_positions == 0) q[j] = rounded(position, s.position_step[j]);
        const bool passive = arm.joints[static_cast<std::size_t>(j)].passive;
        const double torque =
            passive ? 0.0 : track.tau(k, j) + s.torque_noise * torque_rms[j] * noise[j];
        if (k % s.slow_torques == 0)
          tau[j] = currents && !passive ? torque / s.constant[j] : torque;
      }
      for (Index j = 0; j < n; ++j) append(text, q[j]);
      for (Index j = 0; j < n; ++j) append(text, tau[j]);
      for (Index j = 0; s.commands && j < n; ++j) append(text, track.qcmd(k, j));
      for (Index j = 0; s.velocities && j < n; ++j) {
        const double deviation = 30.0 * (s.position_noise[j] + 0.3 * s.position_step[j]);
        append(text, filtered[j] + deviation * draw.normal());
      }
      text += "\n";
    }
  }
  write_text(stem.string() + ".csv", text);

  Json sidecar{{"schema", "diffnea/recording/1"},
               {"torque_side", "motor"},
               {"torque_sampling", s.centred && !s.middle ? "instant" : "hold"}};
  if (c.plan.period > 0.0) sidecar["period"] = c.plan.period;
  for (Index j = 0; j < n; ++j) {
    const Joint& joint = arm.joints[static_cast<std::size_t>(j)];
    if (joint.passive) sidecar["passive"].push_back(joint.name);
    if (currents && !joint.passive) sidecar["torque_constant"][joint.name] = s.constant[j];
  }
  write_text(stem.string() + ".json", sidecar.dump(1) + "\n");
}

}  // namespace rigs
