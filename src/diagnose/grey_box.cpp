#include "diagnose/grey_box.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace diffnea {
namespace {

/// Bumps at most: a simulation evaluates all of them at every step.
constexpr long kMostBumps = 160;
/// Rows within a width of a bump's centre; with fewer, it is no inducing point.
constexpr long kLeastRows = 8;
/// Intervals of a grid over the range of its variable, coarse to fine.
const std::vector<int> kIntervals{3, 4, 6, 8, 11, 15, 20, 27, 36};
/// s in units of what the whitened rows of one bump see; a decade each way is enough on any data.
const std::vector<double> kDeviations = log_grid(1e-2, 1e4, 25);
/// Of the protected columns' inner products with bumps: below, they are rounding.
constexpr double kDependent = 1e-9;
/// Of its torque: of what the base takes over but for this, too little is known.
constexpr double kAbsorbed = 0.01;
constexpr int kDrawn = 41, kDrawnOfPair = 25;

using Axes = std::vector<Residual::Axis>;

/// A grid of one variable: even, or with points as dense about 0 as `dense` says (friction turns
/// there): x = dense sinh(t), even in t.
struct Spacing {
  int intervals = 6;
  bool about_zero = false;
  auto operator<=>(const Spacing&) const = default;
};

struct Points {
  std::vector<double> centres, widths;
};

Points points(const Spacing& s, double low, double high) {
  const double n = s.intervals;
  // At the middle the points are ten times as dense as at the ends.
  const double dense = 0.1 * std::max(std::abs(low), std::abs(high));
  const auto t_of = [&](double x) { return s.about_zero ? std::asinh(x / dense) : x; };
  const double a = t_of(low), b = t_of(high), h = (b - a) / n;
  Points out;
  for (int i = 0; i <= s.intervals; ++i) {
    const double t = a + h * i;
    out.centres.push_back(s.about_zero ? dense * std::sinh(t) : t);
    out.widths.push_back(s.about_zero ? dense * std::cosh(t) * h : h);
  }
  return out;
}

/// Values of a table's variables at the decimated instants, (times(), variables).
MatX<double> states(const Evidence& e, const Axes& axes) {
  MatX<double> out(e.times(), static_cast<long>(axes.size()));
  for (std::size_t k = 0; k < axes.size(); ++k)
    out.col(static_cast<long>(k)) = (axes[k].velocity ? e.qd() : e.q()).col(axes[k].joint);
  return out;
}

/// Bumps where there is data: every point of the grid with enough used rows about it.
BumpTable grid(const std::vector<Spacing>& spacing, const MatX<double>& x,
               const std::vector<bool>& used) {
  std::vector<Points> axis;
  for (long k = 0; k < x.cols(); ++k) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (long i = 0; i < x.rows(); ++i)
      if (used[static_cast<std::size_t>(i)]) {
        low = std::min(low, x(i, k));
        high = std::max(high, x(i, k));
      }
    axis.push_back(points(spacing[static_cast<std::size_t>(k)], low, high));
  }
  const long n0 = static_cast<long>(axis[0].centres.size());
  const long n1 = axis.size() > 1 ? static_cast<long>(axis[1].centres.size()) : 1;
  std::vector<long> rows(static_cast<std::size_t>(n0 * n1), 0);
  for (long i = 0; i < x.rows(); ++i) {
    if (!used[static_cast<std::size_t>(i)]) continue;
    for (long a = 0; a < n0; ++a) {
      const auto near = [&](long k, long at) {
        const Points& p = axis[static_cast<std::size_t>(k)];
        return std::abs(x(i, k) - p.centres[static_cast<std::size_t>(at)]) <
               p.widths[static_cast<std::size_t>(at)];
      };
      if (!near(0, a)) continue;
      for (long b = 0; b < n1; ++b)
        rows[static_cast<std::size_t>(a * n1 + b)] += n1 == 1 || near(1, b);
    }
  }
  BumpTable out;
  for (long a = 0; a < n0; ++a)
    for (long b = 0; b < n1; ++b) {
      if (rows[static_cast<std::size_t>(a * n1 + b)] < kLeastRows) continue;
      for (std::size_t k = 0; k < axis.size(); ++k) {
        const std::size_t at = static_cast<std::size_t>(k == 0 ? a : b);
        out.centres.push_back(axis[k].centres[at]);
        out.widths.push_back(axis[k].widths[at]);
      }
      out.weights.push_back(0.0);
    }
  return out;
}

/// Every bump of a table at every row, (rows, bumps).
MatX<double> bumps(const BumpTable& table, const MatX<double>& x) {
  const long n = x.cols(), count = static_cast<long>(table.weights.size());
  MatX<double> out = MatX<double>::Ones(x.rows(), count);
  for (long b = 0; b < count; ++b)
    for (long k = 0; k < n; ++k) {
      const double c = table.centres[static_cast<std::size_t>(b * n + k)],
                   h = table.widths[static_cast<std::size_t>(b * n + k)];
      for (long i = 0; i < x.rows(); ++i) out(i, b) *= Residual::bump((x(i, k) - c) / h);
    }
  return out;
}

/// The rows that a remainder is fitted to, at one joint.
class Rows {
 public:
  Rows(const Evidence& evidence, const Search& search, const std::vector<Term>& terms,
       const VecX<double>& beside, long joint)
      : search_(search), joint_(joint), begin_(joint * evidence.times()), m_(evidence.times()) {
    const Projection& projection = search.projection();
    left_ = projection.residual() - projection.project(beside);
    MatX<double> C(left_.size(), 0);
    const auto add = [&](const MatX<double>& columns) {
      C.conservativeResize(Eigen::NoChange, C.cols() + columns.cols());
      C.rightCols(columns.cols()) = columns;
    };
    for (const Term& t : terms) {
      left_ -= t.projected.leftCols(t.width()) * t.values();
      if (t.has_offset()) left_ -= t.projected.col(t.width());
      add(t.projected.leftCols(t.width()));
      if (!t.shapes.empty()) add(projection.project(evidence.columns(t.effect, t.shapes)));
    }
    protected_ = C.middleRows(begin_, m_);
    base_ = projection.basis().middleRows(begin_, m_);
  }

  struct Fit {
    double cost = std::numeric_limits<double>::infinity();  ///< −2 ln of the marginal likelihood
    double gain = 0.0, parameters = 0.0;
    VecX<double> weights;
    MatX<double> root;  ///< of the weights' covariance
  };

  /// @param columns  of every bump in this joint's torque, (times(), bumps)
  Fit fit(const MatX<double>& columns) const {
    const MatX<double> white = search_.whitener().joint(joint_, columns);
    const MatX<double> onto = base_.transpose() * white;
    MatX<double> K = white.transpose() * white - onto.transpose() * onto;
    VecX<double> b = white.transpose() * left_.segment(begin_, m_);
    const MatX<double> N = free_directions(protected_.transpose() * white);
    K = N.transpose() * K * N;
    b = N.transpose() * b;
    Fit best;
    if (N.cols() == 0) return best;
    const Eigen::SelfAdjointEigenSolver<MatX<double>> eigen(K);
    const VecX<double> l = eigen.eigenvalues().cwiseMax(0.0),
                       c = eigen.eigenvectors().transpose() * b;
    const double chi2 = left_.squaredNorm(), unit = 1.0 / std::max(l.mean(), 1e-300);
    for (const double d : kDeviations) {
      const double s2 = d * unit;
      const VecX<double> posterior = (l.array() + 1.0 / s2).inverse();
      const double penalised = chi2 - c.dot(posterior.cwiseProduct(c));
      const double cost = search_.cost(penalised) + (1.0 + s2 * l.array()).log().sum();
      if (cost >= best.cost) continue;
      best.cost = cost;
      const VecX<double> z = posterior.cwiseProduct(c);
      best.gain = 2.0 * z.dot(c) - z.dot(l.cwiseProduct(z));
      best.parameters = l.cwiseProduct(posterior).sum();
      best.weights = N * (eigen.eigenvectors() * z);
      best.root = N * eigen.eigenvectors() * posterior.cwiseSqrt().asDiagonal();
    }
    return best;
  }

  double chi2() const { return left_.squaredNorm(); }

 private:
  /// Orthonormal basis of the weights w with A w = 0.
  static MatX<double> free_directions(const MatX<double>& A) {
    const long n = A.cols();
    if (A.rows() == 0) return MatX<double>::Identity(n, n);
    Eigen::ColPivHouseholderQR<MatX<double>> qr(A.transpose());
    qr.setThreshold(kDependent);
    return (qr.householderQ() * MatX<double>::Identity(n, n)).rightCols(n - qr.rank());
  }

  const Search& search_;
  long joint_, begin_, m_;
  VecX<double> left_;
  MatX<double> protected_, base_;
};

/// Coarser and finer, one axis at a time, as long as the marginal likelihood grows.
BumpTable best_grid(const Rows& rows, const MatX<double>& x, const Axes& axes,
                    const std::vector<bool>& used, int& tried) {
  std::map<std::vector<Spacing>, double> known;
  const auto cost = [&](const std::vector<Spacing>& s) {
    const auto [at, is_new] = known.try_emplace(s, std::numeric_limits<double>::infinity());
    if (!is_new) return at->second;
    const BumpTable table = grid(s, x, used);
    if (table.weights.empty() || static_cast<long>(table.weights.size()) > kMostBumps)
      return at->second;
    return at->second = rows.fit(bumps(table, x)).cost;
  };
  std::vector<Spacing> best;
  double least = std::numeric_limits<double>::infinity();
  const std::size_t kinds = std::size_t{1} << axes.size();
  for (std::size_t kind = 0; kind < kinds; ++kind) {
    std::vector<std::size_t> at(axes.size(), 2);
    bool possible = true;
    const auto spacing = [&] {
      std::vector<Spacing> out;
      for (std::size_t k = 0; k < axes.size(); ++k)
        out.push_back({kIntervals[at[k]], (kind >> k & 1) != 0});
      return out;
    };
    for (std::size_t k = 0; k < axes.size(); ++k)
      possible = possible && (axes[k].velocity || (kind >> k & 1) == 0);
    if (!possible) continue;
    double now = cost(spacing());
    for (bool moved = true; moved;) {
      moved = false;
      for (std::size_t k = 0; k < axes.size(); ++k)
        for (const int by : {1, -1}) {
          const std::size_t from = at[k];
          if (by < 0 ? from == 0 : from + 1 == kIntervals.size()) continue;
          at[k] = by < 0 ? from - 1 : from + 1;
          if (const double then = cost(spacing()); then < now) {
            now = then;
            moved = true;
            break;
          }
          at[k] = from;
        }
    }
    if (now < least) {
      least = now;
      best = spacing();
    }
  }
  tried = static_cast<int>(known.size());
  return best.empty() ? BumpTable{} : grid(best, x, used);
}

/// Most of the table's torque along the fitted motion.
double most_seen(const Evidence& evidence, const Residual& residual) {
  double most = 0.0;
  const int at = 0;
  const double one = 1.0;
  for (const JointSeries& s : evidence.series())
    for (long i = 0; i < s.rows(); ++i) {
      double tau = 0.0;
      JointSample<double> x;
      x.q = s.q.row(i).data();
      x.qd = s.qd.row(i).data();
      residual.add_torque(x, &at, &one, &tau);
      most = std::max(most, std::abs(tau));
    }
  return most;
}

/// The table and its deviation over the range of its variables.
void draw(const Residual& residual, const MatX<double>& root, GreyBox& box) {
  const BumpTable& table = residual.table;
  const std::size_t n = residual.axes.size();
  const int count = n == 1 ? kDrawn : kDrawnOfPair;
  for (std::size_t k = 0; k < n; ++k) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t b = 0; b < table.weights.size(); ++b) {
      low = std::min(low, table.centres[b * n + k] - table.widths[b * n + k]);
      high = std::max(high, table.centres[b * n + k] + table.widths[b * n + k]);
    }
    box.at.emplace_back();
    for (int i = 0; i < count; ++i) box.at.back().push_back(low + (high - low) * i / (count - 1));
  }
  const long points = n == 1 ? count : count * count;
  MatX<double> x(points, static_cast<long>(n));
  for (long i = 0; i < points; ++i)
    for (std::size_t k = 0; k < n; ++k)
      x(i, static_cast<long>(k)) = box.at[k][static_cast<std::size_t>(n == 1   ? i
                                                                      : k == 0 ? i / count
                                                                               : i % count)];
  const MatX<double> B = bumps(table, x);
  const VecX<double> torque =
      B *
      Eigen::Map<const VecX<double>>(table.weights.data(), static_cast<long>(table.weights.size()));
  const VecX<double> std = (B * root).rowwise().norm();
  for (long i = 0; i < points; ++i) {
    box.torque.push_back(std::clamp(torque[i], -table.bound, table.bound));
    box.std.push_back(std[i]);
  }
}

/// One residual of one joint, beside those that are there.
class Trial {
 public:
  Trial(const Model& model, const Evidence& evidence, const Search& search,
        const std::vector<Term>& terms, const HeldOut& held_out)
      : model_(model),
        names_(joint_names(model)),
        evidence_(evidence),
        search_(search),
        terms_(terms),
        held_out_(held_out) {}

  std::optional<Remainder> learn(int dof, const std::vector<std::string>& variables,
                                 const BesideTerms& beside) const {
    const long joint = index_of(evidence_, dof), m = evidence_.times();
    BumpTable table;
    table.variables = variables;
    const Axes axes = Residual::from(table, names_, "diagnose").axes;
    const MatX<double> x = states(evidence_, axes);
    const std::vector<bool>& kept = search_.whitener().kept();
    const std::vector<bool> used(kept.begin() + joint * m, kept.begin() + (joint + 1) * m);
    if (std::ranges::count(used, true) < kLeastRows) return std::nullopt;
    const Rows rows(evidence_, search_, terms_, beside.there, joint);
    int tried = 1;
    table = best_grid(rows, x, axes, used, tried);
    if (table.weights.empty()) return std::nullopt;
    table.variables = variables;
    // Widths are chosen on decimated rows; the fit itself sees the recording's rate.
    const Rows::Fit fit = rows.fit(evidence_.filtered([&](const JointSeries& s) -> RowMatX<double> {
      MatX<double> of(s.rows(), static_cast<long>(axes.size()));
      for (std::size_t k = 0; k < axes.size(); ++k)
        of.col(static_cast<long>(k)) = (axes[k].velocity ? s.qd : s.q).col(axes[k].joint);
      return bumps(table, of);
    }));
    if (fit.weights.size() == 0) return std::nullopt;
    table.weights.assign(fit.weights.data(), fit.weights.data() + fit.weights.size());
    table.bound = std::numeric_limits<double>::max();
    table.bound = most_seen(evidence_, Residual::from(table, names_, "diagnose"));

    Remainder out;
    const std::string& where = names_[static_cast<std::size_t>(dof)];
    static_cast<BoundEffect&>(out.effect) = bind({"residual", where, {}, table}, model_);
    GreyBox& box = out.description;
    box.where = where;
    box.unit = unit_of(dof, "N*m", "N");
    box.variables = variables;
    for (const Residual::Axis& a : axes)
      box.units.push_back(a.velocity ? unit_of(a.joint, "rad/s", "m/s")
                                     : unit_of(a.joint, "rad", "m"));
    box.bumps = static_cast<int>(table.weights.size());
    box.effective_parameters = fit.parameters;
    box.bound = table.bound;
    draw(std::get<Residual>(out.effect.type), fit.root, box);

    const VecX<double> torque = evidence_.torque_of(out.effect);
    const VecX<double> seen = search_.projection().project(torque);
    const double white = search_.whitener()(torque).norm(), left = rows.chi2() - fit.gain;
    const double n = static_cast<double>(search_.rows());
    const double freedom =
        std::max(n - static_cast<double>(search_.projection().rank()) - fit.parameters, 1.0);
    Cause& cause = out.cause;
    cause.effect = "residual";
    cause.where = where;
    cause.verdict = Verdict::kUnknown;
    cause.lm = fit.gain;
    cause.delta_bic = search_.cost(rows.chi2()) - search_.cost(left) -
                      fit.parameters * std::log(n) - 2.0 * std::log(tried);
    cause.visible_share = white > 0.0 ? seen.norm() / white : 0.0;
    cause.torque_share = torque.segment(joint * m, m).norm() /
                         (evidence_.size(joint) * std::sqrt(static_cast<double>(m)));
    const double std = std::sqrt(std::max(1.0, left / freedom)) / std::max(seen.norm(), 1e-300);
    cause.parameters.push_back({"scale", "1", 1.0, std, 1.0 - 1.96 * std, 1.0 + 1.96 * std});
    hold_out(dof, torque, beside, out);
    return out;
  }

 private:
  static long index_of(const Evidence& e, int dof) {
    return std::ranges::find(e.joints(), dof) - e.joints().begin();
  }

  std::string unit_of(int dof, const char* revolute, const char* prismatic) const {
    const int link = moving_links(model_)[static_cast<std::size_t>(dof)];
    return model_.links[static_cast<std::size_t>(link)].type == ModelJoint::kPrismatic ? prismatic
                                                                                       : revolute;
  }

  void hold_out(int dof, const VecX<double>& torque, const BesideTerms& beside,
                Remainder& out) const {
    const Evidence& test = held_out_.evidence();
    const VecX<double> on_test = test.torque_of(out.effect);
    out.torque = {beside.there + torque, beside.here + on_test};
    const auto errors = [&](const BesideTerms& with) {
      return held_out_.errors_with(search_, terms_, with.there, with.here);
    };
    const VecX<double> without = errors(beside), with = errors(out.torque);
    const HeldOutChange change =
        held_out_.compare(held_out_.whitened(search_, without), held_out_.whitened(search_, with));
    out.cause.gain = {
        std::sqrt(change.before), std::sqrt(change.after), 0.0, 0.0, change.low, change.high};
    if (change.before > 0.0) out.cause.gain.explained_share = 1.0 - change.after / change.before;
    GreyBox& box = out.description;
    const long begin = index_of(test, dof) * test.times();
    double count = 0.0;
    for (long row = begin; row < begin + test.times(); ++row) {
      if (!held_out_.used().empty() && !held_out_.used()[static_cast<std::size_t>(row)]) continue;
      box.before += without[row] * without[row];
      box.after += with[row] * with[row];
      box.torque_rms += on_test[row] * on_test[row];
      ++count;
    }
    for (double* v : {&box.before, &box.after, &box.torque_rms})
      *v = std::sqrt(*v / std::max(count, 1.0));
  }

  const Model& model_;
  const std::vector<std::string> names_;
  const Evidence& evidence_;
  const Search& search_;
  const std::vector<Term>& terms_;
  const HeldOut& held_out_;
};

struct Try {
  int joint;
  std::vector<std::string> variables;
};

/// Every joint once: witnesses first, then those without one. Time is no variable of a model.
std::vector<Try> tries(const Model& model, const Evidence& evidence,
                       const std::vector<WitnessScore>& witness) {
  const std::vector<std::string> names = joint_names(model);
  std::vector<Try> out;
  const auto is_time = [](const std::string& v) { return v == "time"; };
  for (const WitnessScore& w : witness)
    if (std::ranges::none_of(w.variables, is_time)) out.push_back({w.joint, w.variables});
  for (const int j : evidence.joints()) {
    const std::string& name = names[static_cast<std::size_t>(j)];
    if (std::ranges::find(out, j, &Try::joint) == out.end())
      out.push_back({j, {"q_" + name, "qd_" + name}});
  }
  // The base holds one already: a second look at the same joint would be one too many.
  std::erase_if(out, [&](const Try& t) {
    return std::ranges::any_of(model.effects, [&](const EffectSpec& e) {
      return e.effect == "residual" && e.where == names[static_cast<std::size_t>(t.joint)];
    });
  });
  return out;
}

}  // namespace

GreyBoxResult grey_box(const Model& model, const Evidence& evidence, const Search& search,
                       const std::vector<Term>& terms, const HeldOut& held_out,
                       const std::vector<WitnessScore>& witness, double accept) {
  const Trial trial(model, evidence, search, terms, held_out);
  GreyBoxResult out;
  out.torque = {VecX<double>::Zero(evidence.rows()),
                VecX<double>::Zero(held_out.evidence().rows())};
  for (const Try& t : tries(model, evidence, witness)) {
    std::optional<Remainder> learned = trial.learn(t.joint, t.variables, out.torque);
    if (!learned || learned->cause.delta_bic <= accept) continue;
    const Cause& cause = learned->cause;
    Term term;
    term.effect = learned->effect;
    if (cause.lm < search.inexact_at(term, terms) || cause.visible_share < kAbsorbed) continue;
    if (!(cause.gain.low > 0.0)) {
      out.refused.push_back(
          {cause.effect, cause.where, "does not help on held-out data", cause.delta_bic});
      continue;
    }
    out.torque = learned->torque;
    out.joints.push_back(std::move(*learned));
  }
  return out;
}

}  // namespace diffnea
