#include <algorithm>
#include <cmath>
#include <future>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/identify/trajectory_fit.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"
#include "identify/window_integrator.hpp"
#include "identify/window_simulator.hpp"

namespace diffnea {
namespace {

/// What is left of a window once its initial state is eliminated.
struct ReducedWindow {
  bool finite = false;
  RowMatX<double> rows;  // (≤ f+1, f+1): [J | r] that no initial state can explain
  MatX<double> R_state;  // (2n, 2n)
  MatX<double> top;      // (2n, f+1)
};

ReducedWindow reduce(const RowMatX<double>& rows, int states) {
  ReducedWindow out;
  const long width = rows.cols();
  const Eigen::HouseholderQR<MatX<double>> qr(rows);
  const long kept = std::min(rows.rows(), width);
  const MatX<double> R = MatX<double>(qr.matrixQR().topRows(kept)).triangularView<Eigen::Upper>();
  const long s = std::min<long>(states, kept);
  out.finite = rows.allFinite() && s == states;
  if (!out.finite) return out;
  out.R_state = R.topLeftCorner(s, s);
  out.top = R.topRightCorner(s, width - s);
  out.rows = R.bottomRightCorner(kept - s, width - s);
  return out;
}

/// Runs `job(i)` for i < count on `threads` threads; results do not depend on their number.
void parallel_for(std::size_t count, int threads,
                  const std::function<void(std::size_t, int)>& job) {
  if (threads <= 1) {
    for (std::size_t i = 0; i < count; ++i) job(i, 0);
    return;
  }
  std::vector<std::future<void>> workers;
  for (int t = 0; t < threads; ++t)
    workers.push_back(std::async(std::launch::async, [&, t] {
      for (std::size_t i = static_cast<std::size_t>(t); i < count;
           i += static_cast<std::size_t>(threads))
        job(i, t);
    }));
  for (auto& w : workers) w.get();
}

/// The first rows of every window, for an early stage.
std::vector<ShootingWindow> shortened(const std::vector<ShootingWindow>& windows, double share) {
  std::vector<ShootingWindow> out = windows;
  for (ShootingWindow& w : out) {
    const long m = std::max<long>(static_cast<long>(share * static_cast<double>(w.time.size())), 8);
    if (m >= static_cast<long>(w.time.size())) continue;
    w.time.resize(static_cast<std::size_t>(m));
    w.q.conservativeResize(m, Eigen::NoChange);
    w.u.conservativeResize(m, Eigen::NoChange);
    w.u_end.conservativeResize(m, Eigen::NoChange);
  }
  return out;
}

/// What a set of windows costs: first those whose simulation blows up, whatever the others gain.
struct Cost {
  long blown_up = 0;
  double sum = 0.0;  ///< of the others

  bool operator<(const Cost& other) const {
    return blown_up < other.blown_up || (blown_up == other.blown_up && sum < other.sum);
  }
};

Cost total(const std::vector<double>& parts) {
  Cost out;
  for (const double c : parts) {
    if (std::isfinite(c))
      out.sum += c;
    else
      ++out.blown_up;
  }
  return out;
}

class TrajectoryFitter {
 public:
  TrajectoryFitter(const Model& model, const FitLayout& layout, const VecX<double>& start,
                   const VecX<double>& scale, const TrajectoryOptions& options,
                   const std::function<bool(const char*, int, double)>& progress)
      : model_(model),
        layout_(layout),
        start_(start),
        scale_(scale),
        options_(options),
        progress_(progress),
        tree_(make_tree(model)) {
    for (std::size_t c = 0; c < layout.linear.size(); ++c)
      if (!layout.linear[c].fixed) free_.push_back(static_cast<int>(c));
    fit_.x = start;
  }

  TrajectoryFit run(std::vector<ShootingWindow>& windows) {
    const int n = layout_.num_dofs;
    for (const ShootingWindow& w : windows) runs_.push_back(w.run);
    std::ranges::sort(runs_);
    runs_.erase(std::unique(runs_.begin(), runs_.end()), runs_.end());
    fit_.sigma = VecX<double>::Ones(n);
    for (std::size_t stage = 0; stage <= options_.stages.size(); ++stage) {
      const bool last = stage == options_.stages.size();
      std::vector<ShootingWindow> now = last ? windows : shortened(windows, options_.stages[stage]);
      for (std::size_t i = 0; i < now.size(); ++i) now[i].state = windows[i].state;
      gauss_newton(now, last ? options_.max_iterations : options_.max_iterations / 2);
      for (std::size_t i = 0; i < now.size(); ++i) windows[i].state = now[i].state;
      if (fit_.interrupted) break;
    }
    return fit_;
  }

 private:
  std::vector<std::unique_ptr<WindowSimulator>> simulators(const VecX<double>& x) {
    std::vector<std::unique_ptr<WindowSimulator>> out;
    for (int t = 0; t < std::max(options_.threads, 1); ++t)
      out.push_back(std::make_unique<WindowSimulator>(model_, layout_, x, free_, runs_, options_));
    return out;
  }

  /// Costs of all windows at x, each from the best of its states along the Gauss–Newton step: a
  /// window near an unstable equilibrium must not hold back the others.
  /// @param from, to  where the step begins and ends, one a window
  /// @param before    costs at the beginning; shorter steps are tried only where the full one is
  /// worse
  std::vector<double> costs(const std::vector<ShootingWindow>& windows, const VecX<double>& x,
                            const std::vector<VecX<double>>& from, std::vector<VecX<double>>& to,
                            const std::vector<double>& before) {
    auto workers = simulators(x);
    std::vector<double> out(windows.size());
    parallel_for(windows.size(), options_.threads, [&](std::size_t i, int t) {
      WindowSimulator& simulator = *workers[static_cast<std::size_t>(t)];
      const VecX<double> full = to[i] - from[i];
      out[i] = simulator.cost(windows[i], to[i], fit_.sigma);
      for (const double share : {0.5, 0.2, 0.05, 0.0}) {
        if (out[i] <= before[i]) break;
        const VecX<double> state = from[i] + share * full;
        const double c = simulator.cost(windows[i], state, fit_.sigma);
        if (c < out[i]) {
          out[i] = c;
          to[i] = state;
        }
      }
    });
    return out;
  }
  std::vector<double> costs(const std::vector<ShootingWindow>& windows, const VecX<double>& x,
                            std::vector<VecX<double>> states) {
    return costs(windows, x, states, states, std::vector<double>(windows.size(), kInfinity));
  }

  /// Output error at the present estimate, one for all joints of a kind: they carry the same
  /// encoders, and what is left is the model's error, which weights by joint would only push from
  /// one joint to the next.
  void update_sigma(const std::vector<ShootingWindow>& windows) {
    const int n = layout_.num_dofs;
    auto workers = simulators(fit_.x);
    VecX<double> sum = VecX<double>::Zero(n), count = VecX<double>::Zero(n);
    for (const ShootingWindow& w : windows) {
      const RowMatX<double> q =
          simulate_window(workers[0]->dynamics(), w, w.state, options_.stepping);
      for (long k = 0; k < q.rows(); ++k)
        for (int j = 0; j < n; ++j)
          if (!std::isnan(w.q(k, j)) && std::isfinite(q(k, j))) {
            sum[j] += std::pow(q(k, j) - w.q(k, j), 2);
            count[j] += 1;
          }
    }
    fit_.samples = static_cast<long>(count.sum());
    for (const JointType kind : {JointType::kRevolute, JointType::kPrismatic}) {
      double of_kind = 0.0, samples = 0.0;
      for (int j = 0; j < n; ++j)
        if (tree_.links[static_cast<std::size_t>(j)].type == kind) {
          of_kind += sum[j];
          samples += count[j];
        }
      for (int j = 0; j < n; ++j)
        if (tree_.links[static_cast<std::size_t>(j)].type == kind)
          fit_.sigma[j] = std::max(std::sqrt(of_kind / std::max(samples, 1.0)), 1e-9);
    }
  }

  void gauss_newton(std::vector<ShootingWindow>& windows, int max_iterations) {
    const long p = static_cast<long>(layout_.linear.size());
    const int n = layout_.num_dofs, f = static_cast<int>(free_.size());
    update_sigma(windows);
    double damping = 1e-4;
    std::vector<VecX<double>> states;
    for (const ShootingWindow& w : windows) states.push_back(w.state);
    std::vector<double> parts = costs(windows, fit_.x, states);
    Cost now = total(parts);
    fit_.converged = false;
    fit_.termination = "iteration limit";
    int rounds = 0;
    // Without free parameters windows know nothing of each other, and one that has converged rests.
    std::vector<char> done(windows.size(), 0);
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      // Linearise every window and eliminate its initial state.
      auto workers = simulators(fit_.x);
      std::vector<ReducedWindow> reduced(windows.size());
      parallel_for(windows.size(), options_.threads, [&](std::size_t i, int t) {
        if (done[i] != 0) return;
        RowMatX<double> rows;
        if (workers[static_cast<std::size_t>(t)]->rows(windows[i], fit_.sigma, rows))
          reduced[i] = reduce(rows, 2 * n);
      });
      TriangularFactor whole(f);
      for (const ReducedWindow& r : reduced)
        if (r.finite) whole.add(r.rows);
      fit_.R = MatX<double>::Zero(f, p);
      const MatX<double> R = whole.R();
      for (int k = 0; k < f; ++k) fit_.R.col(free_[static_cast<std::size_t>(k)]) = R.col(k);
      // R (x_new − x) = −r, r what no initial state explains
      const VecX<double> d = fit_.R * fit_.x - whole.d();
      set_covariance(reduced);

      bool accepted = false;
      double gained = 0.0;                  // infinite: a window that blew up does no more
      const int attempts = f == 0 ? 1 : 8;  // damping holds parameters alone
      for (int attempt = 0; attempt < attempts && !accepted; ++attempt) {
        const VecX<double> x_new = step(d, damping);
        std::vector<VecX<double>> next = states;
        VecX<double> dx(f);
        for (int k = 0; k < f; ++k)
          dx[k] = x_new[free_[static_cast<std::size_t>(k)]] -
                  fit_.x[free_[static_cast<std::size_t>(k)]];
        for (std::size_t i = 0; i < windows.size(); ++i) {
          if (!reduced[i].finite) continue;
          const VecX<double> rhs = -reduced[i].top.col(f) - reduced[i].top.leftCols(f) * dx;
          next[i] += reduced[i].R_state.fullPivLu().solve(rhs);
        }
        const std::vector<double> tried = costs(windows, x_new, states, next, parts);
        const Cost after = total(tried);
        if (after < now) {
          gained = after.blown_up < now.blown_up ? kInfinity : now.sum - after.sum;
          now = after;
          if (f == 0)
            for (std::size_t i = 0; i < windows.size(); ++i)
              done[i] = parts[i] - tried[i] <= options_.tolerance * tried[i] ? 1 : 0;
          parts = tried;
          fit_.x = x_new;
          states = next;
          for (std::size_t i = 0; i < windows.size(); ++i) windows[i].state = states[i];
          damping = std::max(damping * 0.2, 1e-9);
          accepted = true;
        } else {
          damping *= 10.0;
        }
      }
      ++fit_.iterations;
      fit_.objective = now.sum;
      if (progress_ && !progress_("simulating", fit_.iterations, now.sum)) {
        fit_.interrupted = true;
        fit_.termination = "interrupted";
        return;
      }
      if (!accepted || gained < options_.tolerance * now.sum) {
        // Converged for this noise; weigh the joints anew, twice at most.
        const VecX<double> before = fit_.sigma;
        update_sigma(windows);
        const double change = (fit_.sigma.cwiseQuotient(before).array() - 1.0).abs().maxCoeff();
        if (change < 0.01 || ++rounds > 3) {
          fit_.converged = now.blown_up == 0;
          fit_.termination = accepted ? "gain below tolerance" : "no lower point along the step";
          break;
        }
        parts = costs(windows, fit_.x, states);
        now = total(parts);
        damping = 1e-4;
        done.assign(windows.size(), 0);
      }
    }
    if (now.blown_up > 0)
      fit_.termination += "; the simulation of " + std::to_string(now.blown_up) + " of " +
                          std::to_string(windows.size()) + " windows blows up";
  }

  /// (H + Λ)⁻¹ Σ_w g_w g_wᵀ (H + Λ)⁻¹ plus the prior's part: the rows of a window are far from
  /// independent, the windows are not.
  void set_covariance(const std::vector<ReducedWindow>& reduced) {
    const long p = static_cast<long>(layout_.linear.size()), f = static_cast<long>(free_.size());
    MatX<double> meat = MatX<double>::Zero(f, f), H = MatX<double>::Zero(f, f);
    for (const ReducedWindow& r : reduced) {
      if (!r.finite || r.rows.rows() == 0) continue;
      const MatX<double> J = r.rows.leftCols(f);
      const VecX<double> g = J.transpose() * r.rows.col(f);
      meat += g * g.transpose();
      H += J.transpose() * J;
    }
    for (long k = 0; k < f; ++k) {
      const double weak = std::pow(1.0 / (10.0 * scale_[free_[static_cast<std::size_t>(k)]]), 2);
      H(k, k) += weak;
      meat(k, k) += weak;
    }
    const VecX<double> s = H.diagonal().cwiseSqrt().cwiseInverse();
    const MatX<double> inverse =
        s.asDiagonal() *
        Eigen::LDLT<MatX<double>>(MatX<double>(s.asDiagonal() * H * s.asDiagonal()))
            .solve(MatX<double>(MatX<double>::Identity(f, f))) *
        s.asDiagonal();
    fit_.covariance = MatX<double>::Zero(p, p);
    fit_.covariance(free_, free_) = inverse * meat * inverse;
  }

  /// Levenberg–Marquardt step as a convex fit: consistency exact, damping and prior as Gaussians.
  VecX<double> step(const VecX<double>& d, double damping) {
    const long p = static_cast<long>(layout_.linear.size());
    const long f = fit_.R.rows();
    ConvexFitProblem problem;
    problem.R = MatX<double>::Zero(f + p, p);
    problem.d = VecX<double>::Zero(f + p);
    problem.R.topRows(f) = fit_.R;
    problem.d.head(f) = d;
    for (const int c : free_) {
      // What the data cannot tell stays where the fit began.
      const double weak = 1.0 / (10.0 * scale_[c]);
      problem.R(f + c, c) = weak;
      problem.d[f + c] = weak * start_[c];
    }
    problem.start = fit_.x;
    problem.bodies = layout_.bodies();
    problem.prior_information = MatX<double>::Zero(p, p);
    for (long c = 0; c < p; ++c) {
      const double curvature = fit_.R.col(c).squaredNorm() + std::pow(0.1 / scale_[c], 2);
      problem.prior_information(c, c) = damping * curvature;
      if (layout_.linear[static_cast<std::size_t>(c)].fixed)
        problem.fixed.push_back(static_cast<int>(c));
      else if (layout_.linear[static_cast<std::size_t>(c)].sign != Sign::kFree)
        problem.nonnegative.push_back(static_cast<int>(c));
    }
    return solve_convex_fit(problem).x;
  }

  const Model& model_;
  const FitLayout& layout_;
  const VecX<double>& start_;
  const VecX<double>& scale_;
  const TrajectoryOptions& options_;
  const std::function<bool(const char*, int, double)>& progress_;
  Tree<double> tree_;
  std::vector<int> free_, runs_;
  TrajectoryFit fit_;
};

}  // namespace

TrajectoryFit fit_trajectories(const Model& model, const FitLayout& layout,
                               const VecX<double>& start, const VecX<double>& scale,
                               std::vector<ShootingWindow>& windows,
                               const TrajectoryOptions& options,
                               const std::function<bool(const char*, int, double)>& progress) {
  return TrajectoryFitter(model, layout, start, scale, options, progress).run(windows);
}

}  // namespace diffnea
