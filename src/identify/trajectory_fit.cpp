#include <algorithm>
#include <cmath>
#include <future>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/identify/trajectory_fit.hpp>

#include "identify/window_integrator.hpp"

namespace diffnea {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The model at given parameters, with sensitivities to (initial state | free parameters).
class WindowSimulator {
 public:
  WindowSimulator(const Model& model, const FitLayout& layout, const VecX<double>& x,
                  const std::vector<int>& free, const std::vector<int>& runs,
                  const TrajectoryOptions& options)
      : layout_(layout),
        free_(free),
        options_(options),
        dynamics_(extend(apply_fit(model, layout, x, shapes(layout)), runs)),
        geometry_(dynamics_.model().tree),
        n_(layout.num_dofs),
        f_(static_cast<int>(free.size())) {
    effects_ = layout.effects;
    for (std::size_t c = 0; c < layout.linear.size(); ++c)
      if (layout.linear[c].effect >= 0)
        effects_[layout.linear[c].effect].parameters[layout.linear[c].index] =
            x[static_cast<long>(c)];
    slot_.assign(layout.linear.size(), -1);
    for (int k = 0; k < f_; ++k) slot_[free[k]] = k;
    effect_columns_.resize(effects_.size());
    for (std::size_t c = 0; c < layout.linear.size(); ++c)
      if (layout.linear[c].effect >= 0)
        effect_columns_[layout.linear[c].effect].push_back(static_cast<int>(c));
  }

  ForwardDynamics& dynamics() { return dynamics_; }

  /// Residual rows q̂ − q over sigma: [J_state | J_parameters | residual]; false if it blew up.
  bool rows(const ShootingWindow& w, const VecX<double>& sigma, RowMatX<double>& out) {
    const int width = 2 * n_ + f_;
    out.resize(static_cast<long>(w.time.size()) * n_, width + 1);
    MatX<double> A = MatX<double>::Zero(2 * n_, 1 + width);
    A.col(0) = w.state;
    A.middleCols(1, 2 * n_).setIdentity();
    long filled = 0;
    const bool finite = integrate(
        w, fastest_rate(dynamics_, w), options_.stepping.max_step, A,
        [&](const VecX<double>& u, const MatX<double>& at, MatX<double>& d) {
          sensitivity_slope(w.run, u, at, d);
        },
        [&](long k, const MatX<double>& at) {
          for (int j = 0; j < n_; ++j) {
            if (std::isnan(w.q(k, j))) continue;
            out.row(filled).head(width) = at.row(j).tail(width) / sigma[j];
            out(filled++, width) = (at(j, 0) - w.q(k, j)) / sigma[j];
          }
        });
    out.conservativeResize(filled, Eigen::NoChange);
    return finite;
  }

  /// ½ Σ (residual/σ)² of one window; +∞ if it blew up.
  double cost(const ShootingWindow& w, const VecX<double>& state, const VecX<double>& sigma) {
    MatX<double> z = state;
    double sum = 0.0;
    const bool finite =
        integrate(w, fastest_rate(dynamics_, w), options_.stepping.max_step, z,
                  state_slope(dynamics_, w.run), [&](long k, const MatX<double>& at) {
                    for (int j = 0; j < n_; ++j)
                      if (!std::isnan(w.q(k, j)))
                        sum += 0.5 * std::pow((at(j, 0) - w.q(k, j)) / sigma[j], 2);
                  });
    return finite ? sum : kInfinity;
  }

 private:
  static VecX<double> shapes(const FitLayout& layout) {
    VecX<double> out(layout.shape.size());
    for (std::size_t s = 0; s < layout.shape.size(); ++s) out[s] = layout.shape[s].prior;
    return out;
  }

  /// d/dt [z | Z]: Z̈_q = ∂q̈/∂q Z_q + ∂q̈/∂q̇ Z_q̇ − M⁻¹ C in the parameters' columns.
  void sensitivity_slope(int run, const VecX<double>& u, const MatX<double>& A, MatX<double>& dA) {
    dynamics_.linearise(A.data(), A.data() + n_, u.data(), run);
    columns(run, A.col(0), dynamics_.qdd());
    dA.resize(A.rows(), A.cols());
    dA.topRows(n_) = A.bottomRows(n_);
    dA.bottomRows(n_).noalias() = dynamics_.dqdd_dq() * A.topRows(n_);
    dA.bottomRows(n_).noalias() += dynamics_.dqdd_dqd() * A.bottomRows(n_);
    dA.bottomRows(n_).rightCols(f_).noalias() -= dynamics_.inverse_mass_matrix() * C_;
    dA.col(0).tail(n_) = dynamics_.qdd();
  }

  /// C = ∂τ/∂x at q̈, at the links (armature and friction over 1 + ε): ∂q̈/∂x = −M⁻¹ C.
  void columns(int run, const VecX<double>& z, const VecX<double>& qdd) {
    C_.setZero(n_, f_);
    const VecX<double> q = z.head(n_), qd = z.tail(n_);
    const RowMatX<double>& Y = torque_regressor<double, double>(geometry_, q, qd, qdd, ws_);
    for (int c = 0; c < kThetaSize * n_; ++c)
      if (slot_[c] >= 0) C_.col(slot_[c]) = Y.col(c);
    JointSample<double> x;
    x.run = run;
    x.q = q.data();
    x.qd = qd.data();
    x.qdd = qdd.data();
    x.tau = qdd.data();
    for (std::size_t e = 0; e < effects_.size(); ++e) {
      const std::vector<int>& at = effect_columns_[e];
      if (at.empty() || std::ranges::all_of(at, [&](int c) { return slot_[c] < 0; })) continue;
      if (effects_[e].info().port == Port::kModelParameter) {
        for (std::size_t k = 0; k < at.size(); ++k)
          if (slot_[at[k]] >= 0)
            C_.col(slot_[at[k]]) =
                Y.col(kThetaSize * effects_[e].joints.at(0) + static_cast<long>(k));
        continue;
      }
      scratch_.resize(at.size() * n_);
      linear_columns(effects_[e], x, scratch_.data());
      for (std::size_t k = 0; k < at.size(); ++k)
        if (slot_[at[k]] >= 0)
          C_.col(slot_[at[k]]) = Eigen::Map<const VecX<double>>(scratch_.data() + k * n_, n_)
                                     .cwiseQuotient(dynamics_.gains());
    }
  }

  const FitLayout& layout_;
  const std::vector<int>& free_;
  const TrajectoryOptions& options_;
  ForwardDynamics dynamics_;
  Tree<double> geometry_;
  int n_, f_;
  std::vector<BoundEffect> effects_;
  std::vector<std::vector<int>> effect_columns_;
  std::vector<int> slot_;  // per linear column: its place among the free ones, −1 if fixed
  RegressorWorkspace<double, double> ws_;
  MatX<double> C_;
  std::vector<double> scratch_;
};

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

double total(const std::vector<double>& parts) {
  double sum = 0.0;
  for (const double c : parts) sum += c;
  return sum;
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
    double now = total(parts);
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
      double gained = 0.0;
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
        const double after = total(tried);
        if (after < now) {
          gained = now - after;
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
      fit_.objective = now;
      if (progress_ && !progress_("simulating", fit_.iterations, now)) {
        fit_.interrupted = true;
        fit_.termination = "interrupted";
        return;
      }
      if (!accepted || gained < options_.tolerance * now) {
        // Converged for this noise; weigh the joints anew, twice at most.
        const VecX<double> before = fit_.sigma;
        update_sigma(windows);
        const double change = (fit_.sigma.cwiseQuotient(before).array() - 1.0).abs().maxCoeff();
        if (change < 0.01 || ++rounds > 3) {
          fit_.converged = true;
          fit_.termination = accepted ? "gain below tolerance" : "no lower point along the step";
          break;
        }
        parts = costs(windows, fit_.x, states);
        now = total(parts);
        damping = 1e-4;
        done.assign(windows.size(), 0);
      }
    }
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
    const MatX<double> inverse = s.asDiagonal() *
                                 Eigen::LDLT<MatX<double>>(s.asDiagonal() * H * s.asDiagonal())
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
