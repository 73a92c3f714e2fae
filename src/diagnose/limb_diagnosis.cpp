#include "diagnose/limb_diagnosis.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"
#include "diagnose/chi_square.hpp"
#include "diagnose/thresholds.hpp"
#include "diagnose/window_selection.hpp"
#include "identify/drive_bounds.hpp"
#include "identify/drives.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

using MotionCase = WindowCase<MotionSearch>;

/// Windows below which some cannot be held out and the rest tell anything.
constexpr double kFewestWindows = 8.0;

/// Tells whether simulated runs have derivatives by it.
/// @param led  joints that drives of the model lead: others have no motor to hide
bool can_be_simulated(const Candidate& c, const std::vector<bool>& led) {
  const EffectInfo& info = c.effect.info();
  if (hides_motor(c.effect) || info.has(Trait::kOfServo))
    return c.effect.joints.size() == 1 && led[c.effect.joints.front()];
  return (info.port == Port::kJointTorque || info.has(Trait::kInertia)) &&
         !info.has(Trait::kReadsCommand) && !info.has(Trait::kGain) && !info.has(Trait::kRotor) &&
         !reads_time(c.effect) && c.choices.empty() && !c.linear.empty();
}

using Asked = std::optional<std::vector<std::string>>;

/// Candidates as asked, else all of the catalogue, and parts of the drives' laws.
std::vector<Candidate> candidates_for(const Model& base, const Asked& asked) {
  if (asked && asked->empty()) return {};  // none is this limb's
  std::vector<Candidate> out =
      make_candidates(base, base, asked.value_or(std::vector<std::string>{}), {0},
                      /*link_side=*/false);
  if (asked) return out;
  std::vector<std::string> of_drives;
  for (const EffectInfo& info : catalogue())
    // The base has what drives were told beside positions, if that was logged.
    if (info.has(Trait::kOfServo) && !info.has(Trait::kFedForward)) of_drives.push_back(info.name);
  for (Candidate& c : make_candidates(base, base, of_drives, {0}, /*link_side=*/false))
    out.push_back(std::move(c));
  return out;
}

/// Sets the supply about which a candidate is tried.
/// @return false: it needs one that was never logged
bool has_supply(const std::vector<Recording>& recordings, Candidate& c) {
  if (!c.effect.info().has(Trait::kReadsSupply)) return true;
  const double volts = median_supply(recordings, c.effect.joints.front());
  for (std::size_t k = 0; k < c.effect.parameters.size(); ++k)
    if (c.effect.parameter_info[k].name == "nominal" && volts > 0.0) c.effect.parameters[k] = volts;
  return volts > 0.0;
}

/// Candidates beside the base; the rest is refused by name, once.
std::vector<Candidate> candidates_beside(const Model& base, const Asked& asked,
                                         const std::vector<Recording>& recordings,
                                         const VecX<double>& noise, Finding& finding) {
  std::vector<Candidate> out;
  const std::vector<bool> led = led_joints(base);
  for (Candidate& c : candidates_for(base, asked)) {
    const EffectSpec spec{c.effect.info().name, c.effect.where, {}};
    if (holds_effect(base.effects, spec)) continue;
    if (!has_supply(recordings, c))
      finding.refused.push_back(
          {spec.effect, spec.where,
           "not tried: no row has a supply (a column voltage or voltage_JOINT [V], above 0)", 0.0});
    else if (c.effect.info().has(Trait::kInertia) && !describes_gains(base))
      finding.refused.push_back(
          {spec.effect, spec.where,
           "not tried: beside drives whose gains the description does not have, a mass is told as "
           "a ratio to them",
           0.0});
    else if (can_be_simulated(c, led)) {
      sharpen(noise, c.effect);
      out.push_back(std::move(c));
    } else if (c.effect.info().port == Port::kMemory || asked)
      finding.refused.push_back(
          {spec.effect, spec.where, "not tried: simulated runs have no derivative by it", 0.0});
  }
  return out;
}

/// Horizon of the search [s]: what a closed loop remembers, or less, where that leaves enough
/// windows to hold some out.
/// @param names  of the joints
double horizon_of(const IdentifyResult& base, const std::vector<std::string>& names,
                  const MotionData& data, bool has_test) {
  double reached = 0.0;
  for (const HorizonError& e : base.horizons)
    if (std::ranges::find(names, e.joint) != names.end()) reached = std::max(reached, e.horizon);
  reached = std::min(reached, kForgets);
  if (has_test) return reached;
  double seconds = 0.0;
  for (const MotionStretch& s : data.train) seconds += s.length();
  return std::min(reached, seconds / kFewestWindows);
}

/// Why a cause is none beside the others; empty: it is one.
/// @param less  the best solution without it, fitted from there
std::string why_nothing(const MotionCase& c, const EffectSpec& t, const MotionSolution& less) {
  if (c.search->may_be_nothing(c.best, t)) return "may be of size zero beside the others";
  if (c.search->is_hidden(less, c.best))
    return "changes simulated runs by less than the encoders' noise";
  if (c.search->delta_bic(less, c.best) < c.options.accept_delta_bic)
    return "the rest of the model explains it, fitted anew";
  return "";
}

/// Leaves out causes that are none beside the others; they are not tried again.
void drop_nothing(MotionCase& c) {
  for (bool dropped = true; dropped && c.go_on();) {
    dropped = false;
    for (const EffectSpec& t : c.best.terms) {
      MotionSolution less = c.search->solve(without_effect(c.best.terms, t), &c.best);
      const std::string why = why_nothing(c, t, less);
      if (why.empty()) continue;
      windows::refuse(c, t, why, c.search->delta_bic(less, c.best));
      c.candidates = without_effect(c.candidates, t);
      c.best = std::move(less);
      dropped = true;
      break;
    }
  }
}

/// The first cause gives way to one that was scored above it, if that does better beside a base
/// which is fitted anew: from the first base, its own fit may have ended short.
void exchange_first(MotionCase& c) {
  if (c.best.terms.size() != 1 || !c.go_on()) return;
  const EffectSpec first = c.best.terms.front();
  const MotionSolution less = c.search->solve({}, &c.best);
  for (const WindowScore& s : c.first_scores) {
    if (same_effect(s.effect, first) || !c.go_on()) return;
    if (!holds_effect(c.candidates, s.effect)) continue;  // it was dropped before
    MotionSolution other = c.search->solve({s.effect}, &less, c.search->reach(less, c.best, 0.0));
    if (!(c.search->delta_bic(c.best, other) > 0.0)) continue;
    c.best = std::move(other);
    return;
  }
}

void note_parameters(const MotionSolution& best, Finding& f) {
  const long p = best.fit.x.size();
  const auto add = [&](const std::vector<FitParameter>& list, const VecX<double>& values,
                       long from) {
    for (std::size_t k = 0; k < list.size(); ++k) {
      const FitParameter& q = list[k];
      if (q.effect >= 0 && holds_effect(best.terms, {best.layout.effects[q.effect].info().name,
                                                     best.layout.effects[q.effect].where,
                                                     {}}))
        continue;
      const long c = from + static_cast<long>(k);
      const double std = std::sqrt(std::max(best.fit.covariance(c, c), 0.0));
      f.parameters.push_back(
          {q.name, q.unit, values[k], q.fixed ? 0.0 : std, q.prior, !q.fixed, q.fixed, false});
    }
  };
  add(best.layout.linear, best.fit.x, 0);
  add(best.layout.shape, best.fit.shape, p);
}

/// Numbers of drives, rotors and friction that are not the description's beyond doubt, where that
/// moves a joint by more than noise hides.
/// @param described  fit of the base, which knows where it began
/// @param period     of rows [s]: a delay by half of it may be one of the stamps
/// @param samples    of all joints
/// @param together   samples that count as one
void note_refuted(const MotionSolution& best, const IdentifyResult& described, double period,
                  double samples, double together, Finding& f) {
  const double sure = std::sqrt(kVeryStrong + std::log(samples / together));  // standard errors
  const double of_joint = samples / static_cast<double>(best.layout.num_dofs);
  const auto add = [&](const FitParameter& p, double value, long column) {
    if (p.fixed || p.effect < 0) return;
    const BoundEffect& effect = best.layout.effects[p.effect];
    const auto find = [&](const std::string& name) {
      return std::ranges::find(described.parameters, name, &ParameterEstimate::name);
    };
    const auto known = find(p.name), gain = find(effect.where + ".position_servo.stiffness");
    if (effect.joints.size() != 1 || known == described.parameters.end() ||
        gain == described.parameters.end() ||
        holds_effect(best.terms, {effect.info().name, effect.where, {}}))
      return;
    if (column < best.fit.x.size() && gain->prior == 0.0) return;  // no drive is described
    const double std = std::sqrt(std::max(best.fit.covariance(column, column), 0.0)),
                 off = std::abs(value - known->prior);
    if (!(off > sure * std) || (p.name.ends_with(".delay") && off < 0.5 * period)) return;
    const bool was_none =
        is_bound_of_drive(best.layout, p) && known->prior == no_bound(best.layout, p);
    const double step = p.logarithmic ? std::abs(std::log(value / known->prior)) : off,
                 moves = step * best.fit.R.col(column).norm() / std::sqrt(of_joint);
    if (moves * moves > kHiddenByNoise)
      f.drives.push_back({p.name, p.unit, was_none ? kNaN : known->prior, value, std, moves});
  };
  for (std::size_t k = 0; k < best.layout.linear.size(); ++k)
    add(best.layout.linear[k], best.fit.x[k], k);
  for (std::size_t k = 0; k < best.layout.shape.size(); ++k)
    add(best.layout.shape[k], best.fit.shape[k], best.fit.x.size() + static_cast<long>(k));
}

/// Held-out positions, of both models, over their joints' noise.
void note_joints(MotionCase& c, const Model& model, const MotionSearchData& of) {
  Finding& f = c.finding;
  const std::vector<RowMatX<double>> before = c.search->held_out_errors(c.base),
                                     after = c.search->held_out_errors(c.best);
  const VecX<double> size = motion_size(c.search->held_out_stretches());
  const std::vector<std::string> names = joint_names(model);
  for (std::size_t j = 0; j < names.size(); ++j) {
    const long column = j;
    const auto rms = [&](const std::vector<RowMatX<double>>& errors) {
      double sum = 0.0, n = 0.0;
      for (const RowMatX<double>& e : errors)
        for (const double x : e.col(column))
          if (std::isfinite(x)) sum += x * x, n += 1.0;
      return of.data.noise.position[column] * std::sqrt(sum / std::max(n, 1.0));
    };
    f.joints.push_back({names[j], unit_of_joint(model, static_cast<int>(j), false), size[column],
                        rms(before), rms(after),
                        f.gain.noise_floor * of.data.noise.position[column]});
  }
}

void describe_candidates(MotionCase& c) {
  Finding& f = c.finding;
  // The rest in the end tells how much of it hangs together by itself.
  const double together = c.search->correlation(c.best), n = c.search->samples();
  for (const WindowScore& s : c.first_scores) {
    const double better =
        window_delta_bic(c.base.cost, c.base.cost - s.lm, n, together, s.parameters);
    f.lack_of_fit_p = std::min(
        f.lack_of_fit_p, static_cast<double>(c.first_scores.size()) *
                             chi_square_tail(s.lm / together, static_cast<int>(s.parameters)));
    if (s.visible_share < kAbsorbed)
      f.absorbed.push_back({s.effect.effect, s.effect.where, s.visible_share});
    else
      f.candidates.push_back({s.effect.effect, s.effect.where, better, s.lm, s.visible_share, {}});
  }
  f.lack_of_fit = c.base.cost / std::max(n, 1.0);
}

void describe_causes(MotionCase& c) {
  Finding& f = c.finding;
  const HeldOutChange change = c.search->held_out(c.base, c.best, c.options.seed);
  const double floor = std::min(1.0, change.after);
  f.gain = gain_of(change, floor);
  for (const EffectSpec& t : c.best.terms) {
    const MotionSolution less = c.search->solve(without_effect(c.best.terms, t), &c.best);
    f.causes.push_back(window_cause(c, t, less));
    f.causes.back().gain = gain_of(c.search->held_out(less, c.best, c.options.seed), floor);
  }
}

}  // namespace

std::vector<bool> led_joints(const Model& model) {
  std::vector<bool> out(joint_names(model).size(), false);
  for (const EffectSpec& e : model.effects)
    if (find_effect(e.effect).has(Trait::kReadsCommand)) out[find_joint(model, e.where)] = true;
  return out;
}

LimbDiagnosis::LimbDiagnosis(LimbRobot robot, const IdentifyResult& base, FitChoice choice,
                             std::optional<std::vector<std::string>> asked,
                             const RecordingSource& train, const RecordingSource* test,
                             const MotionOptions& motion, const DiagnoseOptions& options)
    : robot_(std::move(robot)),
      asked_(std::move(asked)),
      train_(robot_.recordings(train)),
      test_(test ? robot_.recordings(*test) : nullptr),
      of_{*train_, test_.get(), std::move(choice), motion, {}, 0.0},
      described_(base),
      case_(options, finding_) {
  finding_.interrupted = base.summary.interrupted;
  std::vector<std::string> said_already;
  of_.data =
      motion_data(robot_.model(), *train_, test_.get(), led_joints(robot_.model()), said_already);
  of_.horizon = horizon_of(base, joint_names(robot_.model()), of_.data, test_ != nullptr);
}

void LimbDiagnosis::search() {
  MotionCase& c = case_;
  std::vector<Candidate> candidates = candidates_beside(robot_.model(), asked_, of_.train.sample(),
                                                        of_.data.noise.position, finding_);
  for (const Candidate& one : candidates)
    c.candidates.push_back({one.effect.info().name, one.effect.where, {}});
  c.search = std::make_unique<MotionSearch>(
      robot_.model(), of_, std::move(candidates),
      [&c](const std::string& stage, int more) { return c.tell(stage, more); });
  c.base = c.best = c.search->solve({}, nullptr);
  if (c.go_on())
    for (const EffectSpec& e : c.search->hidden_by_noise(c.base, c.candidates)) {
      windows::refuse(c, e, "not tried: no more than noise is left at its joint", 0.0);
      c.candidates = without_effect(c.candidates, e);
    }
  if (c.go_on()) c.first_scores = c.search->scores(c.base, c.candidates);
  const std::size_t joints = joint_names(robot_.model()).size(),
                    most = c.options.max_causes > 0 ? static_cast<std::size_t>(c.options.max_causes)
                                                    : std::max<std::size_t>(8, 3 * joints);
  if (c.go_on())
    select_windows(
        c, most,
        [&c] {
          exchange_first(c);
          drop_nothing(c);
        },
        [] { return false; }, [&c] { return c.search->is_at_noise(c.best); });
  if (c.go_on()) c.best = c.search->with_told_sizes(c.best);
  // Beside its causes a drive may have been found where the base alone had not come.
  if (c.go_on() && !c.best.terms.empty())
    if (MotionSolution back = c.search->solve({}, &c.best); back.cost < c.base.cost)
      c.base = std::move(back);
}

double LimbDiagnosis::least() {
  double out = kInfinity;
  for (const EffectSpec& t : case_.best.terms)
    out = std::min(out, case_.search->delta_bic(without(t), case_.best));
  return out;
}

void LimbDiagnosis::drop_least() {
  const auto lacked = [&](const EffectSpec& t) {
    return case_.search->delta_bic(without(t), case_.best);
  };
  case_.best = without(*std::ranges::min_element(case_.best.terms, {}, lacked));
}

MotionSolution LimbDiagnosis::without(const EffectSpec& cause) {
  return case_.search->solve(without_effect(case_.best.terms, cause), &case_.best);
}

void LimbDiagnosis::describe() {
  describe_candidates(case_);
  describe_causes(case_);
  note_parameters(case_.best, finding_);
  note_refuted(case_.best, described_, of_.data.noise.period.minCoeff(), samples(),
               case_.search->correlation(case_.best), finding_);
  note_joints(case_, robot_.model(), of_);
}

}  // namespace diffnea
