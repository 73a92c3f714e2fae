#include "diagnose/joint_diagnosis.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"
#include "diagnose/base.hpp"
#include "diagnose/chi_square.hpp"
#include "diagnose/error_series.hpp"
#include "diagnose/grey_box.hpp"
#include "diagnose/inexact.hpp"
#include "diagnose/joint_case.hpp"
#include "diagnose/next_experiment.hpp"
#include "diagnose/selection.hpp"
#include "diagnose/simulated.hpp"
#include "diagnose/thresholds.hpp"
#include "diagnose/turns.hpp"
#include "diagnose/unsteady.hpp"

namespace diffnea {
namespace {

/// Value over the lowest that is looked for, up to which a descent has ended there.
constexpr double kAtBound = 1.05;

/// Lateness of torques that is worth a word [samples].
constexpr double kWorthASample = 0.2;

/// How often the rows are made about what was named.
constexpr int kPassesBesideCauses = 2;

class JointDiagnosis {
 public:
  /// @param test    null: rows of `train` are held out
  /// @param floats  whose model and sources these are; null: the base is fixed
  JointDiagnosis(const Model& model, const RecordingSource& train, const RecordingSource* test,
                 const DiagnoseOptions& options, Linearisation about, const UnfoldedBase* floats);
  JointDiagnosis(const JointDiagnosis&) = delete;
  JointDiagnosis& operator=(const JointDiagnosis&) = delete;

  void select();
  /// Where the rows are to be linearised beside what is named; without widths, they are.
  Linearisation beside_causes() const;
  Finding finding();

 private:
  /// Widths at which what is named of the base's own dry friction goes: beside other causes the
  /// base's is another than alone. Empty: nothing of it is named.
  std::vector<double> widths_beside_causes() const;
  /// Says that a base whose drives have no dry friction is better identified first.
  void note_friction();
  /// Says where a drive is at its limit more often than a limit is looked for.
  void note_limits();
  /// Says which springs are as stiff as a rotor is heavy that no model states.
  void note_rotors();
  /// Says where torques act at other instants than the sidecar tells.
  void note_instant();
  void describe();
  /// Names oscillations and bursts of joints whose error has no other witness.
  void add_unsteady();
  /// Names joints whose held-out error is far beyond the noise of their signals, where nothing else
  /// witnesses it. What noise was taken to be may hold what no function of the motion tells.
  /// @return share of the held-out mean square that is in excess
  double add_excess();
  void judge();
  /// Errors, parameters and motion of the extended model.
  void complete();
  /// Leaves out causes with which a simulation follows the robot less well, or that none holds
  /// together, the least first.
  void follow(Selection& selection, const std::function<bool(const FitProgress&)>& progress);
  /// Simulates held-out motion with base and extended model.
  /// @return why the latter does not stand; null: it does
  const char* simulate(const Model& extended);
  /// Only where something is left to tell apart: it takes a few seconds.
  void plan_next();
  void add_grey_box();

  JointCase case_;
  double level_sum_ = 0.0;  ///< χ² of the base alone, before any cause
  bool misfit_ = false;     ///< more than noise is left
  std::vector<Score> first_scores_;
  std::vector<Term> terms_;
  std::vector<WitnessScore> witness_;
  GreyBoxResult grey_;
  VecX<double> alone_, beside_;  ///< base parameters, without the causes and with them
  LinearFit fit_;                ///< of the latter
};

JointDiagnosis::JointDiagnosis(const Model& model, const RecordingSource& train,
                               const RecordingSource* test, const DiagnoseOptions& options,
                               Linearisation about, const UnfoldedBase* floats)
    : case_{model, train, test, options, std::move(about), floats} {
  if (options.progress)
    case_.options.progress = [this, told = options.progress](const FitProgress& progress) {
      const bool go_on = told(progress);
      case_.finding.interrupted |= !go_on;
      return go_on;
    };
}

std::vector<double> JointDiagnosis::widths_beside_causes() const {
  if (case_.finding.interrupted) return {};
  std::vector<double> out;
  bool named = false;
  for (const FitParameter& shape : case_.layout.shape) {
    out.push_back(shape.prior);
    if (!is_smoothing(shape)) continue;
    const BoundEffect own = friction_of(case_.layout, shape);
    for (const Term& t : terms_) {
      if (&t.effect.info() != &own.info() || t.effect.joints != own.joints) continue;
      out.back() = t.effect.parameters[shape.index];
      named = true;
    }
  }
  return named ? out : std::vector<double>{};
}

Linearisation JointDiagnosis::beside_causes() const {
  Linearisation out{case_.about.links, widths_beside_causes(), case_.about.early};
  if (case_.finding.interrupted || terms_.empty() || case_.about.early.size() == 0) return out;
  VecX<double> left = case_.train->torque();
  for (const Term& t : terms_) left -= t.torque();
  FitLayout layout = case_.layout;
  fit_turns(case_.base, *case_.train, left, layout, out.early);
  if ((out.early - case_.about.early).isZero(0.0) || !out.widths.empty()) return out;
  for (const FitParameter& shape : case_.layout.shape) out.widths.push_back(shape.prior);
  return out;
}

Finding JointDiagnosis::finding() {
  describe();
  judge();
  if (case_.finding.verdict == Verdict::kUnknown && case_.options.grey_box &&
      !case_.finding.interrupted)
    grey_ = grey_box(case_.model, *case_.train, *case_.search, terms_, *case_.held_out, witness_,
                     case_.options.accept_delta_bic, case_.base_joints());
  complete();
  plan_next();
  add_grey_box();
  case_.finding.tried = case_.candidates.empty()          ? Tried::kNothing
                        : case_.options.whole_catalogue() ? Tried::kAll
                                                          : Tried::kSome;
  return std::move(case_.finding);
}

void JointDiagnosis::select() {
  prepare(case_);
  const int most = case_.options.max_causes > 0 ? case_.options.max_causes
                                                : std::max(8, 3 * case_.layout.num_dofs);
  Selection selection(*case_.search, case_.candidates, *case_.held_out,
                      {case_.options.accept_delta_bic, most, case_.period, case_.options.seed,
                       [this](const std::vector<Term>& terms) {
                         return case_.reference->rebase(case_.search->projection(), terms);
                       }});
  first_scores_ = case_.search->scores({});
  level_sum_ = case_.search->residual_sum();
  const auto progress = [this](const FitProgress& at) {
    return !case_.options.progress || case_.options.progress(at);
  };
  terms_ = selection.run(progress);
  follow(selection, progress);
  if (static_cast<int>(terms_.size()) >= most)
    case_.finding.notes.push_back("stopped at " + std::to_string(most) +
                                  " causes; the model may lack more");
  for (const Refusal& r :
       selection.refused()) {  // the last word on each that was not accepted after all
    const auto same = [&](const auto& other) {
      return other.effect == r.effect && other.where == r.where;
    };
    std::erase_if(case_.finding.refused, same);
    case_.finding.refused.push_back(r);
  }
  for (const Term& t : terms_)
    std::erase_if(case_.finding.refused, [&](const Refusal& r) {
      return r.effect == t.effect.info().name && r.where == t.effect.where;
    });
  if (!terms_.empty()) {
    case_.finding.causes = selection.causes(terms_);
    note_friction();
    note_limits();
    note_rotors();
  }
}

void JointDiagnosis::note_rotors() {
  for (const Term& t : terms_) {
    const Candidate& c = case_.candidates[t.candidate];
    if (!t.effect.own && encoder_at_motor(t.effect))
      case_.finding.notes.push_back(t.effect.where +
                                    ": its encoder is at the motor, and the link " +
                                    (c.swings > 0.0 ? "swings" : "has play") +
                                    " behind it (encoder_side 1): the log's position is not the "
                                    "link's");
    if (c.effect.info().motor != HiddenMotor::kSpring || !c.rotor_assumed ||
        t.shapes.size() >= c.shapes.size())
      continue;
    const MotorSpring<double> s = motor_spring(t.effect);
    const auto rotor =
        std::ranges::find(t.effect.parameter_info, "motor_inertia", &ParameterInfo::name);
    case_.finding.notes.push_back(
        t.effect.where + ": stiffness and rotor of its spring show as their ratio alone (" +
        format_number(std::sqrt(s.stiffness / s.inertia) / (2.0 * kPi)) +
        " Hz while the link is held). The model states no rotor that goes with these torques: " +
        format_number(s.inertia) + " " + rotor->unit +
        " is assumed, within a factor of four; state `armature` to have the stiffness");
  }
}

void JointDiagnosis::note_limits() {
  for (const Term& t : terms_) {
    const Candidate& c = case_.candidates[t.candidate];
    const auto at = [&] { return t.effect.parameters[c.shapes.front()]; };
    if (c.bound() == SearchBound::kTorque && at() < kAtBound * c.shape_low.front())
      case_.finding.notes.push_back(
          kWarning + t.effect.where +
          ": its limit is the lowest that is looked for: it, and what else is named there, may be "
          "wrong; record a motion that is at the limit less often");
  }
}

void JointDiagnosis::follow(Selection& selection,
                            const std::function<bool(const FitProgress&)>& progress) {
  LinearFit of_base;
  alone_ = final_base(case_.base, case_.layout, *case_.search, *case_.train, {}, {}, of_base);
  for (;;) {
    beside_ = final_base(case_.base, case_.layout, *case_.search, *case_.train, terms_, {}, fit_);
    const char* why =
        case_.finding.interrupted ? nullptr : simulate(case_.reference->extended(beside_, terms_));
    // No model has in others what fitted runs have of their own.
    const auto of_runs = [](const Term& t) { return is_of_runs(t.effect); };
    if (!why || terms_.empty() || std::ranges::any_of(terms_, of_runs)) return;
    const std::size_t least = case_.held_out->shares(*case_.search, terms_).back().first;
    case_.finding.simulated = {};
    selection.resume(terms_, least, why, progress);
  }
}

void JointDiagnosis::note_friction() {
  if (case_.link_side) return;  // identify has no friction of drives there
  const std::vector<std::string> names = joint_names(case_.model);
  const std::set<int> known = dry_joints(case_.layout);
  std::string lack;
  for (std::size_t k = 0; k < case_.train->joints().size(); ++k) {
    const int j = case_.train->joints()[k];
    const auto dry_friction = [&](const Term& t) {
      return t.effect.joints == std::vector<int>{j} &&
             std::ranges::find(t.effect.parameter_info, "smoothing", &ParameterInfo::name) !=
                 t.effect.parameter_info.end();
    };
    if (!known.contains(j) && !case_.train->passive(k) && std::ranges::any_of(terms_, dry_friction))
      lack += (lack.empty() ? "" : ", ") + names[j];
  }
  if (!lack.empty())
    case_.finding.notes.push_back(
        kWarning +
        ("the base has no dry friction at " + lack +
         ", which every drive has: `diffnea identify` fits it with the rest. Diagnose what it "
         "writes; friction that a fit knows of hides other effects less, and less of it is taken "
         "for another friction"));
}

void JointDiagnosis::note_instant() {
  const double late = case_.search->late(terms_);
  if (!(std::abs(late) > kWorthASample)) return;
  const double ms = 1e3 * late * case_.finding.plan.dt;
  case_.finding.notes.push_back(
      "the torques act " + format_number(std::abs(late)) + " samples (" +
      format_number(std::abs(ms)) + " ms) " + (late > 0.0 ? "later" : "earlier") +
      " than `torque_sampling` says: no more than how a drive samples and holds them, so no delay");
}

void JointDiagnosis::describe() {
  for (const Score& s : first_scores_) {
    const Candidate& c = case_.candidates[s.candidate];
    const std::string& name = c.effect.info().name;
    if (s.visible_share < kAbsorbed && s.visible_share > 0.0)
      case_.finding.absorbed.push_back({name, c.effect.where, s.visible_share});
    if (s.variant < 0) continue;
    std::vector<double> shape = case_.search->point_of(s);
    shape.resize(c.shapes.size());
    case_.finding.candidates.push_back(
        {name, c.effect.where, s.delta_bic, s.gain, s.visible_share, std::move(shape)});
  }
  for (const JointNoise& n : case_.search->whitener().noise()) case_.finding.noise.push_back(n.rms);
  // Is there anything to explain? The best of all candidates, as many times as there were trials.
  for (const Score& s : first_scores_) {
    if (s.variant < 0) continue;
    const auto starts = case_.candidates[s.candidate].grid.size();
    case_.finding.lack_of_fit_p =
        std::min(case_.finding.lack_of_fit_p, static_cast<double>(first_scores_.size() * starts) *
                                                  chi_square_tail(s.gain, s.parameters));
  }
  const std::vector<std::string> names = joint_names(case_.model);
  witness_ = find_witnesses(*case_.train, *case_.search, terms_, *case_.held_out, names,
                            case_.options.accept_delta_bic);
  for (const WitnessScore& w : witness_)
    case_.finding.witness.push_back({names[w.joint], w.variables, w.share, w.delta_bic});
  add_unsteady();
  const double excess = case_.drowned ? 0.0 : add_excess();

  const HeldOutChange change =
      case_.held_out->compare(case_.held_out->predicted(*case_.search, std::vector<Term>{}),
                              case_.held_out->predicted(*case_.search, terms_));
  double more = 0.0;  // that smooth functions of the motion would still remove
  for (const WitnessScore& w : witness_)
    more += std::max(0.0, w.held_out.before - w.held_out.after);
  const double freedom = static_cast<double>(
      std::max<long>(case_.search->rows() - case_.search->projection().rank(), 1));
  // Under a tilt the base's columns are no longer those of the base alone.
  case_.finding.lack_of_fit =
      (case_.reference->is_tilted() ? level_sum_ : case_.search->residual_sum()) / freedom;
  misfit_ = case_.search->noise_is_repeatable() &&
            (case_.search->residual_sum() - case_.search->gain_of(terms_) -
             inexact_friction(*case_.search, terms_, true).sum()) /
                    freedom >
                kLeft;
  double floor = std::max(change.after - std::max(more, excess * change.after), 0.0);
  misfit_ = misfit_ || change.after > kFarOff * kFarOff;
  if (misfit_) floor = std::min(floor, 1.0);
  case_.finding.gain = gain_of(change, floor);
  for (Cause& c : case_.finding.causes) c.gain.noise_floor = case_.finding.gain.noise_floor;
}

void JointDiagnosis::add_unsteady() {
  const std::vector<std::string> names = joint_names(case_.model);
  const std::vector<Unsteady> found =
      find_unsteady({*case_.train, case_.search->residual(terms_), case_.search->whitener().kept()},
                    {case_.held_out->evidence(), case_.held_out->errors(*case_.search, terms_),
                     case_.held_out->used()});
  for (const Unsteady& u : found) {
    const std::string& where = names[case_.train->joints()[u.joint]];
    if (std::ranges::find(case_.finding.witness, where, &Witness::where) !=
        case_.finding.witness.end())
      continue;
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    const bool swings = u.frequency_hz > 0.0;
    case_.finding.witness.push_back({where,
                                     {"time"},
                                     u.share,
                                     kNaN,
                                     swings ? WitnessForm::kOscillation : WitnessForm::kBursts,
                                     swings ? u.frequency_hz : kNaN});
  }
}

double JointDiagnosis::add_excess() {
  const Evidence& held = case_.held_out->evidence();
  const Whitener whitener(held, case_.search->whitener().noise(), case_.held_out->used());
  const VecX<double> errors = case_.held_out->errors(*case_.search, terms_),
                     white = whitener(errors);
  const std::vector<std::string> names = joint_names(case_.model);
  double excess = 0.0, all = 0.0;
  for (std::size_t k = 0; k < held.joints().size(); ++k) {
    double left = 0.0, torque = 0.0, of_white = 0.0, rows = 0.0;
    for (long row = static_cast<long>(k) * held.times();
         row < static_cast<long>(k + 1) * held.times(); ++row) {
      if (!whitener.kept()[row]) continue;
      left += errors[row] * errors[row];
      torque += held.torque()[row] * held.torque()[row];
      of_white += white[row] * white[row];
      ++rows;
    }
    all += of_white;
    const double signals = held.signal_noise(k),
                 known = rows * signals * signals + kInexact * kInexact * torque;
    if (held.passive(k) || !(left > kFarOff * kFarOff * known)) continue;
    const double share = 1.0 - known / left;
    excess += share * of_white;
    const std::string& where = names[held.joints()[k]];
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    if (std::ranges::find(case_.finding.witness, where, &Witness::where) ==
        case_.finding.witness.end())
      case_.finding.witness.push_back({where, {"time"}, share, kNaN, WitnessForm::kExcess, kNaN});
  }
  return all > 0.0 ? excess / all : 0.0;
}

void JointDiagnosis::complete() {
  const bool grey = !grey_.joints.empty();
  const VecX<double> e0 = case_.held_out->errors(*case_.search, {});
  const VecX<double> e1 = grey ? case_.held_out->errors_with(*case_.search, terms_,
                                                             grey_.torque.there, grey_.torque.here)
                               : case_.held_out->errors(*case_.search, terms_);
  if (grey) {
    const HeldOutChange change = case_.held_out->compare(
        case_.held_out->predicted(*case_.search, e0), case_.held_out->predicted(*case_.search, e1));
    const double floor = case_.finding.gain.noise_floor * case_.finding.gain.noise_floor;
    case_.finding.gain = gain_of(change, std::min(floor, change.after));
  }
  add_series(e0, e1, case_);
  note_offsets(e1, case_);
  note_instant();
  note_uneven(case_);
  note_floors(case_);
  if (grey)
    beside_ = final_base(case_.base, case_.layout, *case_.search, *case_.train, terms_,
                         grey_.torque.there, fit_);
  if (case_.base == Base::kRefit) {
    case_.finding.parameters =
        parameter_estimates(case_.layout, fit_.x, shapes_at(case_.layout, beside_, terms_),
                            fit_.std, fit_.identifiable, fit_.solver.active_nonnegative);
  }
  case_.finding.model = case_.reference->extended(beside_, terms_);
  for (const Remainder& r : grey_.joints) case_.finding.model.effects.push_back(to_spec(r.effect));
  if (grey && !case_.finding.interrupted) simulate(case_.finding.model);
}

const char* JointDiagnosis::simulate(const Model& extended) {
  if (!case_.finding.simulated.reason.empty()) return nullptr;
  if (!case_.model.constraints.empty())
    case_.finding.simulated.reason = "windows of closed loops are not simulated";
  for (const Term& t : terms_)
    if (t.effect.own) {
      case_.finding.simulated.reason =
          "the extended model cannot hold the candidate " + t.effect.own->name;
      case_.finding.notes.push_back("the extended model lacks " + t.effect.own->name + " at " +
                                    t.effect.where +
                                    ": model files hold effects of the catalogue alone");
    }
  if (!case_.finding.simulated.reason.empty()) return nullptr;
  const RecordingSource& source = case_.test ? *case_.test_source : case_.train_source;
  const auto go_on = [&] {
    return !case_.options.progress || case_.options.progress({"simulating", 0, 0, 0.0});
  };
  // Torques act when the fits have them act.
  const auto motion = [&](const std::vector<Term>& terms) {
    const double late = case_.search->late(terms) * case_.train->series().front().dt;
    return held_out_motion(source, case_.held_out->evidence(), case_.held_rows, late);
  };
  const HeldOutMotion plain = motion({});
  HeldOutSimulation out =
      simulate_held_out(base_at(case_.model, case_.layout, alone_, {}), extended,
                        terms_.empty() && grey_.joints.empty(),
                        {plain, terms_.empty() ? plain : motion(terms_)}, source.runs(), go_on);
  case_.finding.simulated = std::move(out.motion);
  if (!out.unheld.empty()) return "no simulation holds it beside the others";
  return out.loses ? "with it, a simulation follows held-out motion less well" : nullptr;
}

void JointDiagnosis::plan_next() {
  if (case_.finding.interrupted ||
      std::ranges::all_of(case_.finding.causes, [](const Cause& c) { return c.members.empty(); }))
    return;
  if (case_.floats) {
    case_.finding.notes.push_back(
        "no next experiment is proposed: motions of robots that float are not designed");
    return;
  }
  Model reference = case_.finding.model;
  // The causes come last, but for those that no model can hold.
  const auto added = std::ranges::count_if(terms_, [](const Term& t) { return !t.effect.own; });
  reference.effects.resize(reference.effects.size() - static_cast<std::size_t>(added) -
                           grey_.joints.size());
  try {
    case_.finding.next_experiment =
        next_experiment({case_.model, reference, case_.layout, case_.prior, case_.finding.plan,
                         case_.train->joints(), case_.search->whitener().noise(), case_.link_side,
                         case_.candidates, terms_, case_.finding.causes, case_.options.seed});
  } catch (const Error& error) {
    case_.finding.notes.push_back(std::string("no next experiment is proposed: ") + error.what());
  }
}

void JointDiagnosis::add_grey_box() {
  for (const Remainder& r : grey_.joints) {
    case_.finding.grey_box.push_back(r.description);
    case_.finding.causes.push_back(r.cause);
    case_.finding.causes.back().gain.noise_floor = case_.finding.gain.noise_floor;
  }
  for (const Refusal& r : grey_.refused) case_.finding.refused.push_back(r);
}

void JointDiagnosis::judge() {
  Finding& f = case_.finding;
  const bool ambiguous =
      std::ranges::any_of(f.causes, [](const Cause& c) { return c.verdict == Verdict::kClass; });
  // Nothing found says nothing where a channel cannot tell.
  const auto tells_nothing = [](const ChannelFault& fault) {
    return (fault.fault == "dead_channel" || fault.fault == "frozen_channel") &&
           (fault.channel.starts_with("tau_") || fault.channel.starts_with("q_"));
  };
  if (f.causes.empty() && f.witness.empty() &&
      (case_.drowned || std::ranges::any_of(f.audit, tells_nothing)))
    f.verdict = Verdict::kNotIdentifiable;
  else if ((misfit_ || !f.witness.empty()) && f.gain.explained_share < kExplained)
    f.verdict = Verdict::kUnknown;
  else if (f.causes.empty())
    f.verdict = f.candidates.empty() ? Verdict::kNotIdentifiable : Verdict::kNone;
  else
    f.verdict = ambiguous ? Verdict::kClass : Verdict::kNamed;
}

}  // namespace

Finding diagnose_joints(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options,
                        const UnfoldedBase* floats) {
  const auto start = std::chrono::steady_clock::now();
  Linearisation about{model};
  for (int passes = kPassesBesideCauses;; --passes) {
    JointDiagnosis diagnosis(model, train, test, options, about, floats);
    diagnosis.select();
    about = diagnosis.beside_causes();
    if (passes > 0 && !about.widths.empty()) continue;
    Finding out = diagnosis.finding();
    out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return out;
  }
}

}  // namespace diffnea
