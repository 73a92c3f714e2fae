#include "diagnose/simulated.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/motion/horizon.hpp>

#include "core/constants.hpp"
#include "diagnose/held_out.hpp"
#include "diagnose/replayed_windows.hpp"
#include "diagnose/spread_windows.hpp"
#include "identify/passes.hpp"
#include "motion/continuation.hpp"

namespace diffnea {
namespace {

/// Windows at a horizon, at most: they tell an error to a seventh (1/√(2·24)).
constexpr std::size_t kMostWindows = 24;
/// Rows of all windows at a horizon times the square of the joints, which a row costs.
constexpr double kMostWork = 12'000.0;
/// The same where a model is replayed, which costs more.
constexpr double kMostReplayed = 6'000.0;
/// Half a per cent of an error, a per cent of its square, does not show.
constexpr StateFitOptions kStateFit{.max_iterations = 10, .tolerance = 1e-2};
/// Standard errors of a mean over windows.
constexpr double kCertain = 2.0;
/// Share by which a mean square is more where the error is twice as large: a simulation then
/// follows for half as long. Less may be the noise of the torques, which moves the wrong model less
/// if it is the heavier one.
constexpr double kVisibly = 3.0;
/// The same of how long it follows. Short windows alone refute nothing: within the tolerance, what
/// swings unseen when they begin may make an error many times a smaller one.
constexpr double kShorter = 2.0;
/// Share of a mean square by which the noise of some hundred rows makes it differ.
constexpr double kByNoise = 0.05;
constexpr std::size_t kMostPoints = 3000;  ///< of a joint that are kept

/// Rotor of a joint that is held, over the inertia of what it moves.
constexpr double kHeld = 1e6;

/// Keeps a joint where it is: friction of the robot may hold it whatever drives it, and no model
/// knows by how much.
void hold(Tree<double>& tree, const std::vector<int>& joints) {
  MassMatrixWorkspace<double, double> ws;
  const VecX<double> home = VecX<double>::Zero(tree.num_positions());
  const VecX<double> inertia = mass_matrix<double, double>(tree, home, ws).diagonal();
  for (int i = tree.first_joint(); i < tree.num_links(); ++i)
    if (const int dof = tree.drive(i).dof; std::ranges::count(joints, dof) > 0)
      tree.links[i].armature += kHeld * inertia[dof];
}

/// Windows of one model that a simulation leaves.
struct Left {
  std::size_t window = 0;
  int joint = 0;
  double time = 0.0;  ///< instant of the recording [s]
};

struct HorizonErrors {
  VecX<double> rmse;        ///< (n)
  VecX<double> of_windows;  ///< mean squares over the tolerance, summed over the joints
  std::vector<Left> left;
};

/// One model's way up the horizons.
class Climb {
 public:
  Climb(const Model& model, const HeldOutMotion& motion, const std::vector<int>& runs,
        const std::function<bool()>& go_on)
      : model_(model), motion_(motion), runs_(runs), go_on_(go_on) {}

  /// Estimates the states of windows, which begin where some of the last ones did.
  /// @return whether nobody has stopped it
  bool rise(const std::vector<MotionWindow>& windows, double first_horizon) {
    std::vector<MotionWindow> next = windows;
    set_measured_states(motion_.stretches, first_horizon, next);
    for (MotionWindow& w : next) {
      for (const MotionWindow& from : windows_)
        if (from.stretch == w.stretch && from.first == w.first) w.state = from.state;
      if (!go_on_()) return false;
      StateFitOptions options = kStateFit;  // beyond the tolerance, by how much is of no interest
      options.hopeless = 0.5 * static_cast<double>(w.rows * motion_.tolerance.size());
      fit_state(simulator(w), motion_.stretches[w.stretch], w, motion_.tolerance, options);
    }
    windows_ = std::move(next);
    return true;
  }

  RowMatX<double> positions(const MotionWindow& w) {
    return simulator(w).positions(motion_.stretches[w.stretch], w);
  }

  HorizonErrors errors() {
    const long n = motion_.tolerance.size();
    VecX<double> squares = VecX<double>::Zero(n), rows = squares;
    HorizonErrors out;
    out.of_windows.resize(std::ssize(windows_));
    for (std::size_t i = 0; i < windows_.size(); ++i) {
      const MotionWindow& w = windows_[i];
      const MotionStretch& s = motion_.stretches[w.stretch];
      const RowMatX<double> q = positions(w);
      VecX<double> of_window = VecX<double>::Zero(n), count = of_window;
      std::optional<Left> first;
      const auto held = motion_.resting.find(s.run);
      for (long k = 0; k < w.rows; ++k)
        for (int j = 0; j < n; ++j) {
          if (held != motion_.resting.end() && std::ranges::count(held->second, j) > 0) continue;
          const double error = q(k, j) - s.q(w.first + k, j);
          const bool measured = !std::isnan(s.q(w.first + k, j));
          if (measured) {
            of_window[j] += error * error;
            count[j] += 1.0;
          }
          if (!first && (std::isnan(q(k, j)) || (measured && std::abs(error) > motion_.size[j])))
            first = Left{i, j, s.time[w.first + k]};
        }
      const VecX<double> most = count.cwiseProduct(motion_.size.cwiseAbs2());
      const bool apart = !(of_window.array() <= most.array()).all();
      if (apart && first) out.left.push_back(*first);
      for (long j = 0; j < n; ++j)
        if (!(of_window[j] <= most[j])) of_window[j] = most[j];
      out.of_windows[i] =
          of_window.cwiseQuotient(count.cwiseMax(1.0).cwiseProduct(motion_.tolerance.cwiseAbs2()))
              .sum();
      squares += of_window;
      rows += count;
    }
    out.rmse = squares.cwiseQuotient(rows.cwiseMax(1.0)).cwiseSqrt();
    return out;
  }

  const std::vector<MotionWindow>& windows() const { return windows_; }

 private:
  WindowSimulator& simulator(const MotionWindow& w) {
    const int run = motion_.stretches[w.stretch].run;
    std::unique_ptr<WindowSimulator>& out = of_run_[run];
    if (out) return *out;
    ExtendedTree tree = extend(model_, runs_, run);
    if (const auto at = motion_.resting.find(run); at != motion_.resting.end())
      hold(tree.tree, at->second);
    if (needs_replay(tree))
      out = std::make_unique<ReplayedWindows>(std::move(tree), motion_.begins.at(run));
    else
      out = std::make_unique<PathWindows>(std::move(tree));
    return *out;
  }

  const Model& model_;
  const HeldOutMotion& motion_;
  const std::vector<int>& runs_;
  const std::function<bool()>& go_on_;
  std::map<int, std::unique_ptr<WindowSimulator>> of_run_;
  std::vector<MotionWindow> windows_;  ///< with their states
};

/// Both models, the base's windows and the extended one's.
class Both {
 public:
  Both(const Model& base, const Model& extended, bool alike,
       const std::array<HeldOutMotion, 2>& motions, const std::vector<int>& runs, const std::function<bool()>& go_on)
      : names_(joint_names(base)),
        motion_(motions[0]),
        alike_(alike),
        climbs_{Climb(base, motions[0], runs, go_on), Climb(extended, motions[1], runs, go_on)},
        most_(needs_replay(extend(base, runs)) || needs_replay(extend(extended, runs))
                  ? kMostReplayed
                  : kMostWork) {
    for (std::size_t j = 0; j < names_.size(); ++j) {
      SimulatedSeries s;
      s.joint = names_[j];
      s.unit = unit_of_joint(base, static_cast<int>(j), false);
      s.noise = motion_.noise.position[j];
      s.tolerance = motion_.tolerance[j];
      out_.joints.push_back(s);
    }
  }

  HeldOutSimulation run() {
    const std::vector<double> ladder = horizons(motion_.stretches, motion_.noise, {});
    std::vector<MotionWindow> windows =
        spread_windows(motion_.stretches, ladder.front(), kMostWindows);
    for (const double horizon : ladder) {
      windows = lengthened(motion_.stretches, windows, horizon, most_);
      if (windows.empty() || !at(horizon, windows, ladder.front())) break;
      if (!goes_on_[0] && !goes_on_[1]) break;
    }
    if (out_.horizons.empty()) {
      out_.joints.clear();
      out_.reason = windows.empty() ? "no held-out stretch is long enough for a window"
                                    : "it was interrupted";
    } else {
      conclude();
    }
    const bool far_shorter = kShorter * out_.extended_follows < out_.base_follows;
    return {std::move(out_), worse_ && !better_ && far_shorter, {}};
  }

 private:
  bool at(double horizon, const std::vector<MotionWindow>& windows, double first) {
    SimulatedHorizon h;
    h.horizon = horizon;
    h.windows = static_cast<int>(windows.size());
    const std::array<bool, 2> goes_on = goes_on_;
    std::array<VecX<double>, 2> of_windows;
    for (std::size_t m = 0; m < (alike_ ? 1 : 2); ++m)
      if (goes_on[m] && !climbs_[m].rise(windows, first)) return false;
    for (std::size_t m = 0; m < (alike_ ? 1 : 2); ++m) {
      if (!goes_on[m]) continue;
      const HorizonErrors errors = climbs_[m].errors();
      of_windows[m] = errors.of_windows;
      const int apart = static_cast<int>(errors.left.size());
      (m == 0 ? h.base : h.extended) = errors.rmse.cwiseQuotient(motion_.tolerance).maxCoeff();
      (m == 0 ? h.base_rmse : h.extended_rmse).assign(errors.rmse.begin(), errors.rmse.end());
      (m == 0 ? h.base_apart : h.extended_apart) = apart;
      report(m, errors.left, horizon);
      // Where half of the windows fall apart, longer ones would say nothing new.
      goes_on_[m] = 2 * errors.left.size() < windows.size();
      kept_[m].push_back(climbs_[m].windows());
    }
    if (alike_) {
      h.extended = h.base;
      h.extended_rmse = h.base_rmse;
      h.extended_apart = h.base_apart;
      goes_on_[1] = false;
    }
    out_.horizons.push_back(std::move(h));
    if (of_windows[0].size() > 0 && of_windows[1].size() > 0) weigh(of_windows[0], of_windows[1]);
    return true;
  }

  /// Compares the two models window by window.
  void weigh(const VecX<double>& base, const VecX<double>& extended) {
    const long windows = base.size();
    if (windows < static_cast<long>(kFewestBlocks)) return;
    const VecX<double> more = extended - base;
    const double mean = more.mean(), count = static_cast<double>(windows);
    const double std =
        std::sqrt((more.array() - mean).square().sum() / (count * (count - 1.0)));
    better_ = better_ || mean < -kByNoise * base.mean();
    worse_ = worse_ || (mean > kCertain * std && mean > kVisibly * base.mean());
  }

  /// Names the windows of the first horizon at which some fall apart.
  void report(std::size_t m, const std::vector<Left>& left, double horizon) {
    if (reported_[m] || left.empty()) return;
    reported_[m] = true;
    for (const Left& l : left) {
      const MotionWindow& w = climbs_[m].windows()[l.window];
      out_.apart.push_back({m == 0 ? "base" : "extended", names_[l.joint],
                            motion_.stretches[w.stretch].run - first_run(), l.time, horizon});
    }
  }

  int first_run() const { return motion_.begins.begin()->first; }

  void conclude() {
    std::vector<double> length;
    for (const SimulatedHorizon& h : out_.horizons) length.push_back(h.horizon);
    const auto over = [&](const auto& error) {
      std::vector<double> errors;
      for (const SimulatedHorizon& h : out_.horizons) errors.push_back(error(h));
      return follows(length, errors);
    };
    out_.base_follows = over([](const SimulatedHorizon& h) { return h.base; });
    out_.extended_follows = over([](const SimulatedHorizon& h) { return h.extended; });
    for (std::size_t j = 0; j < out_.joints.size(); ++j) {
      SimulatedSeries& s = out_.joints[j];
      const auto of = [&](const std::vector<double>& rmse) {
        return rmse.empty() ? kNaN : rmse[j] / s.tolerance;
      };
      s.base_follows = over([&](const SimulatedHorizon& h) { return of(h.base_rmse); });
      s.extended_follows = over([&](const SimulatedHorizon& h) { return of(h.extended_rmse); });
    }
    draw();
    leave_out_held();
  }

  /// Leaves joints out that are held in all runs: they follow nothing.
  void leave_out_held() {
    const auto is_held = [&](int j) {
      return std::ranges::all_of(motion_.begins, [&](const auto& run) {
        const auto at = motion_.resting.find(run.first);
        return at != motion_.resting.end() && std::ranges::count(at->second, j) > 0;
      });
    };
    const auto drop = [](auto& of_joints, std::size_t j) {
      if (j < of_joints.size()) of_joints.erase(of_joints.begin() + static_cast<long>(j));
    };
    for (std::size_t j = out_.joints.size(); j-- > 0;) {
      if (!is_held(static_cast<int>(j))) continue;
      drop(out_.joints, j);
      for (SimulatedHorizon& h : out_.horizons) drop(h.base_rmse, j), drop(h.extended_rmse, j);
    }
  }

  /// Draws the first horizon that the base model does not follow, else the last one; of longer ones
  /// those that the extended model follows, while the base's windows hold together.
  void draw() {
    std::size_t shown = 0;
    while (shown + 1 < kept_[0].size() && out_.horizons[shown].base <= 1.0) ++shown;
    while (shown + 1 < kept_[0].size() && out_.horizons[shown + 1].extended <= 1.0 &&
           out_.horizons[shown + 1].base_apart == 0)
      ++shown;
    const SimulatedHorizon& h = out_.horizons[shown];
    out_.window = h.horizon;
    const std::vector<MotionWindow>& of_base = kept_[0][shown];
    const std::size_t second = alike_ ? 0 : 1;
    const bool both = shown < kept_[second].size();
    long rows = 0;
    for (const MotionWindow& w : of_base) rows += w.rows;
    const long stride = 1 + (rows - 1) / static_cast<long>(kMostPoints);
    for (std::size_t i = 0; i < of_base.size(); ++i) {
      const MotionWindow& w = of_base[i];
      const MotionStretch& stretch = motion_.stretches[w.stretch];
      const RowMatX<double> q0 = climbs_[0].positions(w);
      const RowMatX<double> q1 = both ? climbs_[second].positions(kept_[second][shown][i]) : q0;
      for (std::size_t j = 0; j < out_.joints.size(); ++j) {
        SimulatedSeries& s = out_.joints[j];
        const long c = j;
        for (long k = 0; k < w.rows; k += stride) {
          const bool ends = k + stride >= w.rows;
          s.time.push_back(stretch.time[w.first + k]);
          s.measured.push_back(stretch.q(w.first + k, c));
          s.base.push_back(ends ? kNaN : q0(k, c));
          s.extended.push_back(ends || !both ? kNaN : q1(k, c));
        }
      }
    }
    for (std::size_t j = 0; j < out_.joints.size(); ++j) {
      out_.joints[j].base_rmse = h.base_rmse.empty() ? kNaN : h.base_rmse[j];
      out_.joints[j].extended_rmse = h.extended_rmse.empty() ? kNaN : h.extended_rmse[j];
    }
  }

  std::vector<std::string> names_;
  const HeldOutMotion& motion_;
  bool alike_;
  std::array<Climb, 2> climbs_;
  double most_;  ///< work at a horizon
  std::array<bool, 2> goes_on_{true, true}, reported_{};
  bool better_ = false, worse_ = false;  ///< the extended model at a horizon
  std::array<std::vector<std::vector<MotionWindow>>, 2> kept_;  ///< windows of each horizon
  SimulatedMotion out_;
};

}  // namespace

double follows(const std::vector<double>& horizons, const std::vector<double>& errors) {
  double out = 0.0;
  for (std::size_t k = 0; k < horizons.size() && !std::isnan(errors[k]); ++k) {
    if (errors[k] <= 1.0) {
      out = horizons[k];
      continue;
    }
    if (k == 0) return 0.0;
    // An error of 0 is within any tolerance, but no point of a scale of ratios.
    const double before = std::log(std::max(errors[k - 1], 1e-12)), after = std::log(errors[k]);
    const double share = before < 0.0 ? -before / (after - before) : 0.0;
    return horizons[k - 1] * std::pow(horizons[k] / horizons[k - 1], share);
  }
  return out;
}

HeldOutSimulation simulate_held_out(const Model& base, const Model& extended, bool alike,
                                    const std::array<HeldOutMotion, 2>& motion,
                                    const std::vector<int>& runs,
                                    const std::function<bool()>& go_on) {
  HeldOutSimulation out;
  out.motion.reason = motion[0].reason;
  if (!out.motion.reason.empty()) return out;
  try {
    out = Both(base, extended, alike, motion, runs, go_on).run();
  } catch (const Error& e) {
    if (!alike) {  // is it what the extended model has more?
      out = simulate_held_out(base, base, true, motion, runs, go_on);
      if (out.motion.reason.empty()) out.unheld = e.what();
    }
    out.motion.reason = e.what();
  }
  return out;
}

}  // namespace diffnea
