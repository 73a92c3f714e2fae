#include "diagnose/motion_diagnosis.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/stepping.hpp>
#include <diffnea/recording/audit.hpp>

#include "core/constants.hpp"
#include "diagnose/chi_square.hpp"
#include "diagnose/motion_search.hpp"
#include "diagnose/simulated.hpp"
#include "diagnose/thresholds.hpp"
#include "diagnose/window_selection.hpp"
#include "identify/drives.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// Windows below which some cannot be held out and the rest tell anything.
constexpr double kFewestWindows = 8.0;

/// Mean square over that of the noise from which more than noise is left: reads of a joint at rest
/// are rounded alike, and up to half of the encoder's noise does not show in its signal.
constexpr double kUnseenNoise = 2.0;

struct MotionCase : WindowCase<MotionSearch> {
  using WindowCase::WindowCase;
};

std::vector<bool> led_joints(const Model& model) {
  std::vector<bool> out(joint_names(model).size(), false);
  for (const EffectSpec& e : model.effects)
    if (find_effect(e.effect).has(Trait::kReadsCommand))
      out[static_cast<std::size_t>(find_joint(model, e.where))] = true;
  return out;
}

/// Tells whether simulated runs have derivatives by it.
/// @param led  joints that drives of the model lead: others have no motor to hide
bool can_be_simulated(const Candidate& c, const std::vector<bool>& led) {
  const EffectInfo& info = c.effect.info();
  if (hides_motor(c.effect) || info.has(Trait::kOfServo))
    return c.effect.joints.size() == 1 && led[static_cast<std::size_t>(c.effect.joints.front())];
  return info.port == Port::kJointTorque && !info.has(Trait::kReadsCommand) &&
         !info.has(Trait::kGain) && !info.has(Trait::kRotor) &&
         !reads_time(c.effect) && c.choices.empty() && !c.linear.empty();
}

/// Candidates as asked, else all of the catalogue, and parts of the drives' laws.
std::vector<Candidate> candidates_for(const Model& base, const DiagnoseOptions& options) {
  std::vector<Candidate> out =
      make_candidates(base, base, options.effects, {0}, /*link_side=*/false);
  if (!options.effects.empty()) return out;
  std::vector<std::string> of_drives;
  for (const EffectInfo& info : catalogue())
    if (info.has(Trait::kOfServo)) of_drives.push_back(info.name);
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
std::vector<Candidate> candidates_beside(const Model& base, const DiagnoseOptions& options,
                                         const std::vector<Recording>& recordings,
                                         const VecX<double>& noise, Finding& finding) {
  std::vector<Candidate> out;
  const std::vector<bool> led = led_joints(base);
  for (Candidate& c : candidates_for(base, options)) {
    const EffectSpec spec{c.effect.info().name, c.effect.where, {}};
    if (holds_effect(base.effects, spec)) continue;
    if (!has_supply(recordings, c))
      finding.refused.push_back({spec.effect, spec.where,
                                 "not tried: no row has a supply (a column voltage or voltage_" +
                                     spec.where + " [V], above 0)",
                                 0.0});
    else if (can_be_simulated(c, led)) {
      sharpen(noise, c.effect);
      out.push_back(std::move(c));
    } else if (c.effect.info().port == Port::kMemory || !options.effects.empty())
      finding.refused.push_back(
          {spec.effect, spec.where, "not tried: simulated runs have no derivative by it", 0.0});
  }
  return out;
}

/// Horizon of the search [s]: what a closed loop remembers, or less, where that leaves enough
/// windows to hold some out.
double horizon_of(double reached, const MotionData& data, bool has_test) {
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
      if (q.effect >= 0 &&
          holds_effect(best.terms,
                       {best.layout.effects[static_cast<std::size_t>(q.effect)].info().name,
                        best.layout.effects[static_cast<std::size_t>(q.effect)].where,
                        {}}))
        continue;
      const long c = from + static_cast<long>(k);
      const double std = std::sqrt(std::max(best.fit.covariance(c, c), 0.0));
      f.parameters.push_back({q.name, q.unit, values[static_cast<long>(k)], q.fixed ? 0.0 : std,
                              q.prior, !q.fixed, q.fixed, false});
    }
  };
  add(best.layout.linear, best.fit.x, 0);
  add(best.layout.shape, best.fit.shape, p);
}

/// Held-out positions, of both models, over their joints' noise.
void note_joints(MotionCase& c, const MotionSearchData& of) {
  Finding& f = c.finding;
  const std::vector<RowMatX<double>> before = c.search->held_out_errors(c.base),
                                     after = c.search->held_out_errors(c.best);
  const VecX<double> size = motion_size(c.search->held_out_stretches());
  const std::vector<std::string> names = joint_names(f.model);
  for (std::size_t j = 0; j < names.size(); ++j) {
    const long column = static_cast<long>(j);
    const auto rms = [&](const std::vector<RowMatX<double>>& errors) {
      double sum = 0.0, n = 0.0;
      for (const RowMatX<double>& e : errors)
        for (const double x : e.col(column))
          if (std::isfinite(x)) sum += x * x, n += 1.0;
      return of.data.noise.position[column] * std::sqrt(sum / std::max(n, 1.0));
    };
    f.joints.push_back({names[j], unit_of_joint(f.model, static_cast<int>(j), false),
                        size[column], rms(before), rms(after),
                        f.gain.noise_floor * of.data.noise.position[column]});
  }
}

/// @throws ModelError for what has no meaning where drives make the torque
void require_own_base(const DiagnoseOptions& options) {
  if (options.base == Base::kPrior || options.base == Base::kFixed)
    throw ModelError("--base: got " +
                     std::string(options.base == Base::kPrior ? "prior" : "fixed") +
                     "; where no torque was recorded, drives are fitted with the causes: expected "
                     "refit or auto");
  if (!options.candidates.empty())
    throw ModelError("diagnose: got candidate '" + options.candidates.front().name +
                     "'; where no torque was recorded, only effects of the catalogue are tried");
}

/// Fits the base, and what it lacks.
void search(MotionCase& c, const Model& base, const MotionSearchData& of) {
  std::vector<Candidate> candidates =
      candidates_beside(base, c.options, of.train.sample(), of.data.noise.position, c.finding);
  for (const Candidate& one : candidates)
    c.candidates.push_back({one.effect.info().name, one.effect.where, {}});
  c.search = std::make_unique<MotionSearch>(
      base, of, std::move(candidates),
      [&c](const std::string& stage, int more) { return c.tell(stage, more); });
  c.base = c.best = c.search->solve({}, nullptr);
  if (c.go_on()) c.first_scores = c.search->scores(c.base, c.candidates);
  const std::size_t joints = joint_names(base).size(),
                    most = c.options.max_causes > 0
                               ? static_cast<std::size_t>(c.options.max_causes)
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

void describe_candidates(MotionCase& c) {
  Finding& f = c.finding;
  // The rest in the end tells how much of it hangs together by itself.
  const double together = c.search->correlation(c.best), n = c.search->samples();
  for (const WindowScore& s : c.first_scores) {
    const double better =
        window_delta_bic(c.base.cost, c.base.cost - s.lm, n, together, s.parameters);
    f.lack_of_fit_p =
        std::min(f.lack_of_fit_p,
                 static_cast<double>(c.first_scores.size()) *
                     chi_square_tail(s.lm / together, static_cast<int>(s.parameters)));
    if (s.visible_share < kAbsorbedMotion)
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
  double all = 0.0;
  for (const EffectSpec& t : c.best.terms) {
    const MotionSolution less = c.search->solve(without_effect(c.best.terms, t), &c.best);
    Cause cause = window_cause(c, t, less);
    cause.gain = gain_of(c.search->held_out(less, c.best, c.options.seed), floor);
    all += cause.lm;
    f.causes.push_back(std::move(cause));
  }
  for (Cause& cause : f.causes) cause.share = all > 0.0 ? cause.lm / all : 0.0;
  std::ranges::stable_sort(f.causes, std::ranges::greater{}, &Cause::delta_bic);
}

void judge(MotionCase& c) {
  Finding& f = c.finding;
  const auto is_class = [](const Cause& x) { return x.verdict == Verdict::kClass; };
  if (f.gain.after * f.gain.after > kUnseenNoise && f.gain.explained_share < kExplained)
    f.verdict = Verdict::kUnknown;
  else if (f.causes.empty())
    f.verdict = f.candidates.empty() ? Verdict::kNotIdentifiable : Verdict::kNone;
  else
    f.verdict = std::ranges::any_of(f.causes, is_class) ? Verdict::kClass : Verdict::kNamed;
}

/// Held-out runs by both models; the finding's model is the extended one then.
void simulate(MotionCase& c, const MotionSearchData& of) {
  const Model before = c.base.model;
  c.finding.model = c.best.model;
  const HeldOutMotion motion =
      motion_of_stretches(c.search->held_out_stretches(), of.data.noise);
  c.finding.simulated = simulate_held_out(before, c.best.model, c.best.terms.empty(),
                                          {motion, motion}, of.data.runs,
                                          [&] { return c.tell("simulating", 0); })
                            .motion;
}

}  // namespace

bool has_commands_alone(const Model& model, const RecordingSource& train) {
  Model begun = model;
  IdentifyOptions options;
  std::vector<std::string> unsaid;
  return fit_drives(begun, train, options, unsaid);
}

Finding diagnose_drives(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  require_own_base(options);
  Finding finding;
  finding.held_out = test ? "test recording" : "time blocks";
  finding.base = "refit";
  finding.audit = audit(train.sample(), {.joints = describe_joints(model)}).faults;

  IdentifyOptions fit;
  fit.progress = options.progress;
  fit.motion.threads = options.threads;
  Model begun = model;
  fit_drives(begun, train, fit, finding.notes);
  const IdentifyResult base = identify_by_motion(begun, train, test, fit);
  finding.interrupted = base.summary.interrupted;
  finding.plan = base.plan;
  finding.data_report = base.data_report;
  finding.model = base.model;
  finding.notes.insert(finding.notes.end(), base.notes.begin(), base.notes.end());

  MotionSearchData of{train, test, fit.choice, fit.motion, {}, 0.0};
  std::vector<std::string> said_already;
  of.data = motion_data(train, test, led_joints(base.model), said_already);
  of.horizon = horizon_of(base.summary.horizon, of.data, test != nullptr);
  for (const double noise : of.data.noise.position) finding.noise.push_back(noise);

  MotionCase c(options, finding);
  search(c, base.model, of);
  describe_candidates(c);
  describe_causes(c);
  note_parameters(c.best, finding);
  note_joints(c, of);
  judge(c);
  simulate(c, of);
  finding.tried = c.candidates.empty() ? Tried::kNothing : Tried::kSome;  // no presliding
  finding.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return finding;
}

}  // namespace diffnea
