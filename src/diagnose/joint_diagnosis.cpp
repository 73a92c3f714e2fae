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

class JointDiagnosis : JointCase {
 public:
  /// @param held  null: rows of `fitted` are held out
  /// @param on    whose model and sources these are; null: the base is fixed
  JointDiagnosis(const Model& of, const RecordingSource& fitted, const RecordingSource* held,
                 const DiagnoseOptions& asked, Linearisation near, const UnfoldedBase* on);
  JointDiagnosis(const JointDiagnosis&) = delete;
  JointDiagnosis& operator=(const JointDiagnosis&) = delete;

  void select();
  /// Where the rows are to be linearised beside what is named; without widths, they are.
  Linearisation beside_causes() const;
  Finding conclude();

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
  bool has_witness(const std::string& joint) const {
    return std::ranges::count(finding.witness, joint, &Witness::where) > 0;
  }
  void judge();
  /// Errors, parameters and motion of the extended model.
  void complete();
  /// Leaves out causes with which a simulation follows the robot less well, or that none holds
  /// together, the least first.
  void follow(Selection& selection);
  /// Simulates held-out motion with base and extended model.
  /// @return why the latter does not stand; null: it does
  const char* simulate(const Model& extended);
  /// Only where something is left to tell apart: it takes a few seconds.
  void plan_next();
  void add_grey_box();

  double level_sum_ = 0.0;  ///< χ² of the base alone, before any cause
  bool misfit_ = false;     ///< more than noise is left
  std::vector<Score> first_scores_;
  std::vector<Term> terms_;
  std::vector<WitnessScore> witness_;
  GreyBoxResult grey_;
  VecX<double> alone_, beside_;  ///< base parameters, without the causes and with them
  LinearFit fit_;                ///< of the latter
};

JointDiagnosis::JointDiagnosis(const Model& of, const RecordingSource& fitted,
                               const RecordingSource* held, const DiagnoseOptions& asked,
                               Linearisation near, const UnfoldedBase* on)
    : JointCase{of, fitted, held, asked, std::move(near), on} {
  if (asked.progress)
    options.progress = [this, told = asked.progress](const FitProgress& progress) {
      const bool go_on = told(progress);
      finding.interrupted |= !go_on;
      return go_on;
    };
}

std::vector<double> JointDiagnosis::widths_beside_causes() const {
  if (finding.interrupted) return {};
  std::vector<double> out;
  bool named = false;
  for (const FitParameter& shape : layout.shape) {
    out.push_back(shape.prior);
    if (!is_smoothing(shape)) continue;
    const BoundEffect own = friction_of(layout, shape);
    for (const Term& t : terms_) {
      if (&t.effect.info() != &own.info() || t.effect.joints != own.joints) continue;
      out.back() = t.effect.parameters[shape.index];
      named = true;
    }
  }
  return named ? out : std::vector<double>{};
}

Linearisation JointDiagnosis::beside_causes() const {
  Linearisation out{about.links, widths_beside_causes(), about.early};
  if (finding.interrupted || terms_.empty() || about.early.size() == 0) return out;
  FitLayout moved = layout;
  fit_turns(base, *train, train->torque() - torque_of(terms_, train->rows()), moved, out.early);
  if ((out.early - about.early).isZero(0.0) || !out.widths.empty()) return out;
  for (const FitParameter& shape : layout.shape) out.widths.push_back(shape.prior);
  return out;
}

Finding JointDiagnosis::conclude() {
  describe();
  judge();
  if (finding.verdict == Verdict::kUnknown && options.grey_box && !finding.interrupted)
    grey_ = grey_box(model, *search, terms_, *held_out, witness_, options.accept_delta_bic,
                     base_joints());
  complete();
  plan_next();
  add_grey_box();
  finding.tried = candidates.empty()          ? Tried::kNothing
                  : options.whole_catalogue() ? Tried::kAll
                                              : Tried::kSome;
  return std::move(finding);
}

void JointDiagnosis::select() {
  prepare(*this);
  const int most = options.max_causes > 0 ? options.max_causes : std::max(8, 3 * layout.num_dofs);
  Selection selection(*search, *held_out,
                      {options.accept_delta_bic, most, period, options.seed,
                       [this](const std::vector<Term>& terms) {
                         return reference->rebase(search->projection(), terms);
                       },
                       options.progress});
  first_scores_ = search->scores({});
  level_sum_ = search->residual_sum();
  terms_ = selection.run();
  follow(selection);
  if (static_cast<int>(terms_.size()) >= most)
    finding.notes.push_back("stopped at " + std::to_string(most) +
                            " causes; the model may lack more");
  for (const Refusal& r :
       selection.refused()) {  // the last word on each that was not accepted after all
    const auto same = [&](const auto& other) {
      return other.effect == r.effect && other.where == r.where;
    };
    std::erase_if(finding.refused, same);
    finding.refused.push_back(r);
  }
  for (const Term& t : terms_)
    std::erase_if(finding.refused, [&](const Refusal& r) {
      return r.effect == t.effect.info().name && r.where == t.effect.where;
    });
  if (!terms_.empty()) {
    finding.causes = selection.causes(terms_);
    note_friction();
    note_limits();
    note_rotors();
  }
}

void JointDiagnosis::note_rotors() {
  for (const Term& t : terms_) {
    const Candidate& c = candidates[t.candidate];
    if (!t.effect.own && encoder_at_motor(t.effect))
      finding.notes.push_back(t.effect.where + ": its encoder is at the motor, and the link " +
                              (c.swings > 0.0 ? "swings" : "has play") +
                              " behind it (encoder_side 1): the log's position is not the "
                              "link's");
    if (c.effect.info().motor != HiddenMotor::kSpring || !c.rotor_assumed ||
        t.shapes.size() >= c.shapes.size())
      continue;
    const MotorSpring<double> s = motor_spring(t.effect);
    finding.notes.push_back(
        t.effect.where + ": stiffness and rotor of its spring show as their ratio alone (" +
        format_number(std::sqrt(s.stiffness / s.inertia) / (2.0 * kPi)) +
        " Hz while the link is held). The model states no rotor that goes with these torques: " +
        format_number(s.inertia) + " " +
        t.effect.parameter_info[t.effect.index_of("motor_inertia")].unit +
        " is assumed, within a factor of four; state `armature` to have the stiffness");
  }
}

void JointDiagnosis::note_limits() {
  for (const Term& t : terms_) {
    const Candidate& c = candidates[t.candidate];
    const auto at = [&] { return t.effect.parameters[c.shapes.front()]; };
    if (c.bound() == SearchBound::kTorque && at() < kAtBound * c.shape_low.front())
      finding.notes.push_back(
          kWarning + t.effect.where +
          ": its limit is the lowest that is looked for: it, and what else is named there, may be "
          "wrong; record a motion that is at the limit less often");
  }
}

void JointDiagnosis::follow(Selection& selection) {
  LinearFit of_base;
  alone_ = final_base(base, layout, *search, {}, {}, of_base);
  for (;;) {
    beside_ = final_base(base, layout, *search, terms_, {}, fit_);
    const char* why =
        finding.interrupted ? nullptr : simulate(reference->extended(beside_, terms_));
    // No model has in others what fitted runs have of their own.
    const auto of_runs = [](const Term& t) { return is_of_runs(t.effect); };
    if (!why || terms_.empty() || std::ranges::any_of(terms_, of_runs)) return;
    const std::size_t least = held_out->shares(*search, terms_).back().first;
    finding.simulated = {};
    selection.resume(terms_, least, why);
  }
}

void JointDiagnosis::note_friction() {
  if (link_side) return;  // identify has no friction of drives there
  const std::vector<std::string> names = joint_names(model);
  const std::set<int> known = dry_joints(layout);
  std::string lack;
  for (std::size_t k = 0; k < train->joints().size(); ++k) {
    const int j = train->joints()[k];
    const auto dry_friction = [&](const Term& t) {
      return t.effect.joints == std::vector<int>{j} && t.effect.index_of("smoothing") >= 0;
    };
    if (!known.contains(j) && !train->passive(k) && std::ranges::any_of(terms_, dry_friction))
      lack += (lack.empty() ? "" : ", ") + names[j];
  }
  if (!lack.empty())
    finding.notes.push_back(
        kWarning +
        ("the base has no dry friction at " + lack +
         ", which every drive has: `diffnea identify` fits it with the rest. Diagnose what it "
         "writes; friction that a fit knows of hides other effects less, and less of it is taken "
         "for another friction"));
}

void JointDiagnosis::note_instant() {
  const double late = search->late(terms_);
  if (!(std::abs(late) > kWorthASample)) return;
  const double ms = 1e3 * late * finding.plan.dt;
  finding.notes.push_back(
      "the torques act " + format_number(std::abs(late)) + " samples (" +
      format_number(std::abs(ms)) + " ms) " + (late > 0.0 ? "later" : "earlier") +
      " than `torque_sampling` says: no more than how a drive samples and holds them, so no delay");
}

void JointDiagnosis::describe() {
  for (const Score& s : first_scores_) {
    const Candidate& c = candidates[s.candidate];
    const std::string& name = c.effect.info().name;
    if (s.visible_share < kAbsorbed && s.visible_share > 0.0)
      finding.absorbed.push_back({name, c.effect.where, s.visible_share});
    if (s.variant < 0) continue;
    std::vector<double> shape = search->point_of(s);
    shape.resize(c.shapes.size());
    finding.candidates.push_back(
        {name, c.effect.where, s.delta_bic, s.gain, s.visible_share, std::move(shape)});
  }
  for (const JointNoise& n : search->whitener().noise()) finding.noise.push_back(n.rms);
  // Is there anything to explain? The best of all candidates, as many times as there were trials.
  for (const Score& s : first_scores_) {
    if (s.variant < 0) continue;
    const auto starts = candidates[s.candidate].grid.size();
    finding.lack_of_fit_p =
        std::min(finding.lack_of_fit_p, static_cast<double>(first_scores_.size() * starts) *
                                            chi_square_tail(s.gain, s.parameters));
  }
  const std::vector<std::string> names = joint_names(model);
  witness_ = find_witnesses(*search, terms_, *held_out, names, options.accept_delta_bic);
  for (const WitnessScore& w : witness_)
    finding.witness.push_back({names[w.joint], w.variables, w.share, w.delta_bic});
  add_unsteady();
  const double excess = drowned ? 0.0 : add_excess();

  const HeldOutChange change = held_out->compare(held_out->predicted(*search, std::vector<Term>{}),
                                                 held_out->predicted(*search, terms_));
  double more = 0.0;  // that smooth functions of the motion would still remove
  for (const WitnessScore& w : witness_)
    more += std::max(0.0, w.held_out.before - w.held_out.after);
  const double freedom =
      static_cast<double>(std::max<long>(search->rows() - search->projection().rank(), 1));
  // Under a tilt the base's columns are no longer those of the base alone.
  finding.lack_of_fit = (reference->is_tilted() ? level_sum_ : search->residual_sum()) / freedom;
  misfit_ = search->noise_is_repeatable() && (search->residual_sum() - search->gain_of(terms_) -
                                              inexact_friction(*search, terms_, true).sum()) /
                                                     freedom >
                                                 kLeft;
  double floor = std::max(change.after - std::max(more, excess * change.after), 0.0);
  misfit_ = misfit_ || change.after > kFarOff * kFarOff;
  if (misfit_) floor = std::min(floor, 1.0);
  finding.gain = gain_of(change, floor);
  for (Cause& c : finding.causes) c.gain.noise_floor = finding.gain.noise_floor;
}

void JointDiagnosis::add_unsteady() {
  const std::vector<std::string> names = joint_names(model);
  const std::vector<Unsteady> found =
      find_unsteady({*train, search->residual(terms_), search->whitener().kept()},
                    {held_out->evidence(), held_out->errors(*search, terms_), held_out->used()});
  for (const Unsteady& u : found) {
    const std::string& where = names[train->joints()[u.joint]];
    if (has_witness(where)) continue;
    const bool swings = u.frequency_hz > 0.0;
    finding.witness.push_back({where,
                               {"time"},
                               u.share,
                               kNaN,
                               swings ? WitnessForm::kOscillation : WitnessForm::kBursts,
                               swings ? u.frequency_hz : kNaN});
  }
}

double JointDiagnosis::add_excess() {
  const Evidence& held = held_out->evidence();
  const Whitener whitener = held_out->whitener(*search);
  const VecX<double> errors = held_out->errors(*search, terms_), white = whitener(errors);
  const std::vector<std::string> names = joint_names(model);
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
    if (!has_witness(where))
      finding.witness.push_back({where, {"time"}, share, kNaN, WitnessForm::kExcess, kNaN});
  }
  return all > 0.0 ? excess / all : 0.0;
}

void JointDiagnosis::complete() {
  const bool grey = !grey_.joints.empty();
  const VecX<double> e0 = held_out->errors(*search, {});
  const VecX<double> e1 =
      grey ? held_out->errors_with(*search, terms_, grey_.torque.there, grey_.torque.here)
           : held_out->errors(*search, terms_);
  if (grey) {
    const HeldOutChange change =
        held_out->compare(held_out->predicted(*search, e0), held_out->predicted(*search, e1));
    const double floor = finding.gain.noise_floor * finding.gain.noise_floor;
    finding.gain = gain_of(change, std::min(floor, change.after));
  }
  add_series(e0, e1, *this);
  note_offsets(e1, *this);
  note_instant();
  note_uneven(*this);
  note_floors(*this);
  if (grey) beside_ = final_base(base, layout, *search, terms_, grey_.torque.there, fit_);
  if (base == Base::kRefit) {
    finding.parameters =
        parameter_estimates(layout, fit_.x, shapes_at(layout, beside_, terms_), fit_.std,
                            fit_.identifiable, fit_.solver.active_nonnegative);
  }
  finding.model = reference->extended(beside_, terms_);
  for (const Remainder& r : grey_.joints) finding.model.effects.push_back(to_spec(r.effect));
  if (grey && !finding.interrupted) simulate(finding.model);
}

const char* JointDiagnosis::simulate(const Model& extended) {
  if (!finding.simulated.reason.empty()) return nullptr;
  if (!model.constraints.empty())
    finding.simulated.reason = "windows of closed loops are not simulated";
  for (const Term& t : terms_)
    if (t.effect.own) {
      finding.simulated.reason =
          "the extended model cannot hold the candidate " + t.effect.own->name;
      finding.notes.push_back("the extended model lacks " + t.effect.own->name + " at " +
                              t.effect.where + ": model files hold effects of the catalogue alone");
    }
  if (!finding.simulated.reason.empty()) return nullptr;
  const RecordingSource& source = test ? *test_source : train_source;
  const auto go_on = [&] {
    return !options.progress || options.progress({"simulating", 0, 0, 0.0});
  };
  // Torques act when the fits have them act.
  const auto motion = [&](const std::vector<Term>& terms) {
    const double late = search->late(terms) * train->series().front().dt;
    return held_out_motion(source, held_out->evidence(), held_rows, late);
  };
  const HeldOutMotion plain = motion({});
  HeldOutSimulation out = simulate_held_out(
      base_at(model, layout, alone_, {}), extended, terms_.empty() && grey_.joints.empty(),
      {plain, terms_.empty() ? plain : motion(terms_)}, source.runs(), go_on);
  finding.simulated = std::move(out.motion);
  if (!out.unheld.empty()) return "no simulation holds it beside the others";
  return out.loses ? "with it, a simulation follows held-out motion less well" : nullptr;
}

void JointDiagnosis::plan_next() {
  if (finding.interrupted ||
      std::ranges::all_of(finding.causes, [](const Cause& c) { return c.members.empty(); }))
    return;
  if (floats) {
    finding.notes.push_back(
        "no next experiment is proposed: motions of robots that float are not designed");
    return;
  }
  Model without = finding.model;
  // The causes come last, but for those that no model can hold.
  const auto added = std::ranges::count_if(terms_, [](const Term& t) { return !t.effect.own; });
  without.effects.resize(without.effects.size() - static_cast<std::size_t>(added) -
                         grey_.joints.size());
  try {
    finding.next_experiment = next_experiment(
        {model, without, layout, prior, finding.plan, train->joints(), search->whitener().noise(),
         link_side, candidates, terms_, finding.causes, options.seed});
  } catch (const Error& error) {
    finding.notes.push_back(std::string("no next experiment is proposed: ") + error.what());
  }
}

void JointDiagnosis::add_grey_box() {
  for (const Remainder& r : grey_.joints) {
    finding.grey_box.push_back(r.description);
    finding.causes.push_back(r.cause);
    finding.causes.back().gain.noise_floor = finding.gain.noise_floor;
  }
  for (const Refusal& r : grey_.refused) finding.refused.push_back(r);
}

void JointDiagnosis::judge() {
  Finding& f = finding;
  const bool ambiguous =
      std::ranges::any_of(f.causes, [](const Cause& c) { return c.verdict == Verdict::kClass; });
  // Nothing found says nothing where a channel cannot tell.
  const auto tells_nothing = [](const ChannelFault& fault) {
    return (fault.fault == "dead_channel" || fault.fault == "frozen_channel") &&
           (fault.channel.starts_with("tau_") || fault.channel.starts_with("q_"));
  };
  if (f.causes.empty() && f.witness.empty() &&
      (drowned || std::ranges::any_of(f.audit, tells_nothing)))
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
    Finding out = diagnosis.conclude();
    out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return out;
  }
}

}  // namespace diffnea
