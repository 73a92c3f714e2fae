#include "identify/ball_pull.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/dynamics/kinematics.hpp>

#include "identify/ball_identify.hpp"
#include "identify/ball_path.hpp"
#include "identify/ball_world.hpp"
#include "identify/whole_runs.hpp"

namespace diffnea {
namespace {

/// A pull that is known from one time to the next [s, N in W].
struct Pull {
  double time;
  Vec3<double> force;
};

/// At the rows of a recording, from the windows that were fitted to it.
std::vector<Pull> pulls(const Model& model, const BallLayout& layout, const VecX<double>& p,
                        const BallData& data, const Recording& r, const BallFitOptions& options) {
  std::vector<Pull> out;
  long row = 0;
  for (std::size_t i = 0; i < data.windows.size(); ++i) {
    const BallWindow& w = data.windows[i];
    if (w.run != r.run) continue;
    const BallWorld<double> world(model, layout, data.hands[static_cast<std::size_t>(w.hand)],
                                  {p.begin(), p.end()});
    BallFlight<double, BallWorld<double>> flight(world, options.flight);
    flight.start(w.time.front() - world.delay(), w.state, w.taut, w.spin);
    // Pictures that are early (a delay below 0) tell of no instant before the first one's own.
    const double early = std::max(0.0, -world.delay());
    while (row < r.rows() && r.time[row] < w.time.front() + early) ++row;
    // Up to where the next window begins.
    const double most = w.time.back() + options.longest_gap;
    const double end = i + 1 < data.windows.size() && data.windows[i + 1].hand == w.hand &&
                               data.windows[i + 1].time.front() <= most
                           ? data.windows[i + 1].time.front() + early
                           : w.time.back();
    for (; row < r.rows() && r.time[row] <= end; ++row) {
      flight.run_until(r.time[row]);
      out.push_back({r.time[row], flight.sample().u * (flight.pull() * model.ball->mass)});
    }
  }
  return out;
}

}  // namespace

std::unique_ptr<RecordingSource> without_ball_pull(const Model& model,
                                                   const RecordingSource& source,
                                                   const BallFitOptions& options,
                                                   const PreprocessOptions& smoothing) {
  if (!model.ball || !model.ball->string || model.ball->string->link < 0) return nullptr;
  const TreeMap map = map_to_tree(model);
  const auto link = static_cast<std::size_t>(model.ball->string->link);
  const int dof = map.dof[link];
  std::vector<Recording> shown = recordings_with_ball(source);
  if (dof < 0 || shown.empty()) return nullptr;

  Model fitted = model;
  BallData data = make_ball_data(fitted, shown, options, smoothing);
  guess_unknown_string(*fitted.ball->string, data, fitted.gravity);
  std::vector<EffectSpec> effects;
  for (const EffectSpec& e : fitted.effects)
    if (acts_on_ball(find_effect(e.effect))) effects.push_back(e);
  const BallLayout layout = make_ball_layout(fitted, effects);
  const VecX<double> p = fit_ball(fitted, layout, data, options).p;

  const Tree<double> tree = make_tree(model);
  const Vec3<double> p_TS = map.X_LF[link].p + map.X_LF[link].R * Vec3<double>{p[1], p[2], p[3]},
                     hanging = model.gravity * model.ball->mass;
  LinkKinematics<double> kinematics;
  for (Recording& r : shown) {
    const std::vector<Pull> known = pulls(fitted, layout, p, data, r, options);
    std::size_t next = 0;
    for (long row = 0; row < r.rows(); ++row) {
      while (next < known.size() && known[next].time < r.time[row]) ++next;
      const bool seen = next < known.size() && known[next].time == r.time[row];
      const Vec3<double> force = seen ? known[next].force : hanging;
      forward_kinematics<double, double>(tree, r.q.row(row).transpose(), kinematics);
      const auto& X_WT = kinematics.links[static_cast<std::size_t>(dof)].X_WL;
      const Vec3<double> point = X_WT.p + X_WT.R * p_TS;
      for (int i = dof; i >= 0; i = tree.links[static_cast<std::size_t>(i)].parent) {
        const auto& L = tree.links[static_cast<std::size_t>(i)];
        const Pose<double>& X_WL = kinematics.links[static_cast<std::size_t>(i)].X_WL;
        const Vec3<double> axis = X_WL.R * L.axis;
        const JointDrive d = tree.drive(i);
        r.tau(row, d.dof) +=
            d.ratio *
            dot(L.type == JointType::kPrismatic ? axis : cross(axis, point - X_WL.p), force);
      }
    }
  }
  std::vector<Recording> all;
  std::size_t next = 0;
  for_each_run(
      source, [](const Recording&) { return true; },
      [&](const Recording& r) {
        const bool corrected = next < shown.size() && shown[next].run == r.run;
        if (corrected)
          all.push_back(std::move(shown[next++]));
        else
          all.push_back(r);
      });
  return recordings_in_memory(model, std::move(all));
}

std::string ball_pull_note(const RecordingSource& source) {
  std::string without;
  for_each_run(
      source, [](const Recording& r) { return r.ball.size() == 0; },
      [&](const Recording& r) { without += (without.empty() ? "" : ", ") + r.source; });
  return "the ball's pull is taken out of the torques" +
         (without.empty() ? ""
                          : ", but not of recordings that do not show the ball, which count as "
                            "recorded without it: " +
                                without);
}

}  // namespace diffnea
