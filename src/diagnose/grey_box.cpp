#include "diagnose/grey_box.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "diagnose/bump_fit.hpp"
#include "diagnose/bump_grid.hpp"
#include "diagnose/inexact.hpp"
#include "diagnose/thresholds.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

constexpr int kDrawn = 41, kDrawnOfPair = 25;

/// Values of a table's variables that go with rows of the k-th joint, (times(), variables).
MatX<double> states(const Evidence& e, long of, const Axes& axes) {
  MatX<double> out(e.times(), std::ssize(axes));
  for (std::size_t k = 0; k < axes.size(); ++k)
    out.col(k) = axes[k].velocity ? e.qd(of).col(axes[k].joint) : e.q(of).col(axes[k].joint);
  return out;
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
  MatX<double> x(points, n);
  for (long i = 0; i < points; ++i)
    for (std::size_t k = 0; k < n; ++k)
      x(i, k) = box.at[k][n == 1 ? i : k == 0 ? i / count : i % count];
  const MatX<double> B = bumps(table, x);
  const VecX<double> torque =
      B * Eigen::Map<const VecX<double>>(table.weights.data(), std::ssize(table.weights));
  const VecX<double> std = (B * root).rowwise().norm();
  for (long i = 0; i < points; ++i) {
    box.torque.push_back(std::clamp(torque[i], -table.bound, table.bound));
    box.std.push_back(std[i]);
  }
}

/// One residual of one joint, beside those that are there.
class Trial {
 public:
  Trial(const Model& model, const Search& search, const std::vector<Term>& terms,
        const HeldOut& held_out)
      : model_(model),
        names_(joint_names(model)),
        evidence_(search.evidence()),
        search_(search),
        terms_(terms),
        held_out_(held_out) {}

  std::optional<Remainder> learn(int dof, const std::vector<std::string>& variables,
                                 const BesideTerms& beside) const {
    const long joint = evidence_.index_of(dof), m = evidence_.times();
    BumpTable table;
    table.variables = variables;
    const Axes axes = Residual::from(table, names_, "diagnose").axes;
    const MatX<double> x = states(evidence_, joint, axes);
    const std::vector<bool>& kept = search_.whitener().kept();
    const std::vector<bool> used(kept.begin() + joint * m, kept.begin() + (joint + 1) * m);
    const BumpRows rows(search_, terms_, beside.there, joint);
    int tried = 1;
    table = best_grid([&](const MatX<double>& columns) { return rows.fit(columns).cost; }, x, axes,
                      used, tried);
    if (table.weights.empty()) return std::nullopt;
    table.variables = variables;
    // Widths are chosen on decimated rows; the fit itself sees the recording's rate.
    const BumpWeights fit =
        rows.fit(evidence_.rows_of(joint, [&](const JointSeries& s) -> RowMatX<double> {
          MatX<double> of(s.rows(), std::ssize(axes));
          for (std::size_t k = 0; k < axes.size(); ++k)
            of.col(k) = (axes[k].velocity ? s.qd : s.q).col(axes[k].joint);
          return bumps(table, of);
        }));
    if (fit.weights.size() == 0) return std::nullopt;
    table.weights.assign(fit.weights.data(), fit.weights.data() + fit.weights.size());
    table.bound = std::numeric_limits<double>::max();
    table.bound = most_seen(evidence_, Residual::from(table, names_, "diagnose"));

    Remainder out;
    const std::string& where = names_[dof];
    static_cast<BoundEffect&>(out.effect) = bind({Residual::info().name, where, {}, table}, model_);
    GreyBox& box = out.description;
    box.where = where;
    box.unit = unit_of_joint(model_, dof, true);
    box.variables = variables;
    for (const Residual::Axis& a : axes)
      box.units.push_back(unit_of_joint(model_, a.joint, false) + (a.velocity ? "/s" : ""));
    box.bumps = static_cast<int>(table.weights.size());
    box.effective_parameters = fit.parameters;
    box.bound = table.bound;
    draw(Residual::from(table, names_, "diagnose"), fit.root, box);

    const VecX<double> torque = evidence_.torque_of(out.effect);
    const VecX<double> seen = search_.projection().project(torque);
    const double white = search_.whitener()(torque).norm(), left = rows.chi2() - fit.gain;
    const double n = static_cast<double>(search_.rows());
    const double freedom =
        std::max(n - static_cast<double>(search_.projection().rank()) - fit.parameters, 1.0);
    Cause& cause = out.cause;
    cause.effect = Residual::info().name;
    cause.where = where;
    cause.verdict = Verdict::kUnknown;
    cause.lm = fit.gain;
    cause.delta_bic = search_.cost(rows.chi2()) - search_.cost(left) -
                      fit.parameters * std::log(n) - 2.0 * std::log(tried);
    cause.visible_share = white > 0.0 ? seen.norm() / white : 0.0;
    cause.torque_share = torque.segment(joint * m, m).norm() /
                         (evidence_.size(joint) * std::sqrt(static_cast<double>(m)));
    const double std = std::sqrt(std::max(1.0, left / freedom)) / std::max(seen.norm(), 1e-300);
    cause.parameters.push_back(
        {"scale", "1", 1.0, std, 1.0 - kNormal95 * std, 1.0 + kNormal95 * std});
    hold_out(dof, torque, beside, out);
    return out;
  }

 private:
  void hold_out(int dof, const VecX<double>& torque, const BesideTerms& beside,
                Remainder& out) const {
    const Evidence& test = held_out_.evidence();
    const VecX<double> on_test = test.torque_of(out.effect);
    out.torque = {beside.there + torque, beside.here + on_test};
    const auto errors = [&](const BesideTerms& with) {
      return held_out_.errors_with(search_, terms_, with.there, with.here);
    };
    const VecX<double> without = errors(beside), with = errors(out.torque);
    const HeldOutChange change = held_out_.compare(held_out_.predicted(search_, without),
                                                   held_out_.predicted(search_, with));
    out.cause.gain = {
        std::sqrt(change.before), std::sqrt(change.after), 0.0, 0.0, change.low, change.high};
    if (change.before > 0.0) out.cause.gain.explained_share = 1.0 - change.after / change.before;
    GreyBox& box = out.description;
    const long k = test.index_of(dof);
    box.before = test.rms(k, without, held_out_.used());
    box.after = test.rms(k, with, held_out_.used());
    box.torque_rms = test.rms(k, on_test, held_out_.used());
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
                       const std::vector<WitnessScore>& witness, int base) {
  const std::vector<std::string> names = joint_names(model);
  std::vector<Try> out;
  const auto is_time = [](const std::string& v) { return v == "time"; };
  for (const WitnessScore& w : witness)
    if (std::ranges::none_of(w.variables, is_time)) out.push_back({w.joint, w.variables});
  for (const int j : evidence.joints()) {
    const std::string& name = names[j];
    if (std::ranges::find(out, j, &Try::joint) == out.end())
      out.push_back({j, {"q_" + name, "qd_" + name}});
  }
  // The base holds one already: a second look at the same joint would be one too many.
  std::erase_if(out, [&](const Try& t) {
    return t.joint < base ||
           std::ranges::any_of(
               model.effects,
               [&](const EffectSpec& e) {
                 return e.effect == Residual::info().name && e.where == names[t.joint];
               });
  });
  return out;
}

}  // namespace

GreyBoxResult grey_box(const Model& model, const Search& search, const std::vector<Term>& terms,
                       const HeldOut& held_out, const std::vector<WitnessScore>& witness,
                       double accept, int base) {
  const Evidence& evidence = search.evidence();
  const Trial trial(model, search, terms, held_out);
  GreyBoxResult out;
  out.torque = {VecX<double>::Zero(evidence.rows()),
                VecX<double>::Zero(held_out.evidence().rows())};
  for (const Try& t : tries(model, evidence, witness, base)) {
    std::optional<Remainder> learned = trial.learn(t.joint, t.variables, out.torque);
    if (!learned || learned->cause.delta_bic <= accept) continue;
    const Cause& cause = learned->cause;
    Term term;
    term.effect = learned->effect;
    if (cause.lm < inexact_at(search, term, terms) || cause.visible_share < kAbsorbed) continue;
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
