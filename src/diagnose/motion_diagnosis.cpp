#include "diagnose/motion_diagnosis.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/parallel.hpp>
#include <diffnea/recording/audit.hpp>

#include "core/append.hpp"
#include "core/constants.hpp"
#include "diagnose/limb_diagnosis.hpp"
#include "diagnose/simulated.hpp"
#include "diagnose/thresholds.hpp"
#include "identify/drive_bounds.hpp"
#include "identify/drives.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// Mean square over that of the noise from which more than noise is left: reads of a joint at rest
/// are rounded alike, and up to half of the encoder's noise does not show in its signal.
constexpr double kUnseenNoise = 2.0;

using Limbs = std::vector<std::unique_ptr<LimbDiagnosis>>;

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

/// Effects that the caller asks for, as they act in the whole robot.
std::vector<BoundEffect> asked_effects(const Model& base, const DiagnoseOptions& options) {
  std::vector<BoundEffect> out;
  if (options.effects.empty()) return out;
  for (Candidate& c : make_candidates(base, base, options.effects, {0}, /*link_side=*/false))
    out.push_back(std::move(c.effect));
  return out;
}

/// A diagnosis of each limb. @param data  of all joints
Limbs diagnoses(const IdentifyResult& base, const IdentifyOptions& fit, const MotionData& data,
                const RecordingSource& train, const RecordingSource* test,
                const DiagnoseOptions& options) {
  FitChoice choice = fit.choice;
  choice.effects = std::vector<std::string>{};  // the base has all
  choice.simulated = true;
  std::vector<std::string> said_already;
  const FitLayout layout = layout_for(base.model, train, test, choice, said_already);
  for (const FitParameter& s : layout.shape) {  // bounds that no run came to
    const auto known = std::ranges::find(base.parameters, s.name, &ParameterEstimate::name);
    if (is_bound_of_drive(layout, s) && known != base.parameters.end() && known->fixed)
      choice.fix.push_back(s.name);
  }
  const std::vector<BoundEffect> asked = asked_effects(base.model, options);
  std::vector<LimbRobot> robots = limb_robots(base.model, layout, data, asked);
  MotionOptions motion = fit.motion;
  motion.threads = std::max(motion.threads / static_cast<int>(robots.size()), 1);
  Limbs out;
  for (LimbRobot& robot : robots) {
    std::optional<std::vector<std::string>> own;
    if (!options.effects.empty()) own.emplace();
    for (const BoundEffect& e : asked)
      if (robot.has(e)) own->push_back(e.info().name + "@" + e.where);
    FitChoice of_limb = robot.choice(layout, choice);
    out.push_back(std::make_unique<LimbDiagnosis>(std::move(robot), base, std::move(of_limb),
                                                  std::move(own), train, test, motion, options));
  }
  return out;
}

/// No more causes than were asked for: those that are lacked most.
void keep_most(const Limbs& limbs, int most) {
  const auto count = [&] {
    std::size_t out = 0;
    for (const auto& limb : limbs) out += limb->best().terms.size();
    return out;
  };
  const auto least = [](const auto& limb) { return limb->least(); };
  while (most > 0 && count() > static_cast<std::size_t>(most))
    (*std::ranges::min_element(limbs, {}, least))->drop_least();
}

/// Held-out errors of the model as it came, of joints whose drives it has.
void note_described(const Model& model, const IdentifyResult& base, Finding& f) {
  const auto has_drive = [&](const std::string& joint) {
    const auto link = std::ranges::find(model.links, joint, &ModelLink::joint);
    return link->servo || std::ranges::any_of(model.effects, [&](const EffectSpec& e) {
             return e.where == joint && find_effect(e.effect).has(Trait::kReadsCommand);
           });
  };
  for (JointGain& g : f.joints)
    for (const JointError& e : base.errors)
      if (e.joint == g.joint && has_drive(g.joint))
        g.described = std::isnan(e.nominal_test) ? e.nominal_train : e.nominal_test;
}

/// Joins what the limbs lack to what the robot lacks.
void join(const Limbs& limbs, const DiagnoseOptions& options, Finding& f) {
  HeldOutBlocks held_out;
  double cost = 0.0, samples = 0.0, lm = 0.0;
  for (const auto& limb : limbs) {
    const Finding& part = limb->finding();
    append(part.causes, f.causes);
    append(part.candidates, f.candidates);
    append(part.absorbed, f.absorbed);
    append(part.refused, f.refused);
    append(part.parameters, f.parameters);
    append(part.joints, f.joints);
    append(part.drives, f.drives);
    f.lack_of_fit_p =
        std::min(f.lack_of_fit_p, static_cast<double>(limbs.size()) * part.lack_of_fit_p);
    f.interrupted = f.interrupted || part.interrupted;
    const HeldOutBlocks blocks = limb->held_out();
    append(blocks.before, held_out.before);
    append(blocks.after, held_out.after);
    held_out.n += blocks.n;
    cost += limb->base().cost;
    samples += limb->samples();
  }
  f.lack_of_fit = cost / std::max(samples, 1.0);
  const HeldOutChange change = change_over(held_out, options.seed);
  f.gain = gain_of(change, std::min(1.0, change.after));
  for (const Cause& cause : f.causes) lm += cause.lm;
  for (Cause& cause : f.causes) cause.share = lm > 0.0 ? cause.lm / lm : 0.0;
  std::ranges::stable_sort(f.causes, std::ranges::greater{}, &Cause::delta_bic);
  std::ranges::stable_sort(f.candidates, std::ranges::greater{}, &CandidateScore::delta_bic);
  std::ranges::stable_sort(f.drives, std::ranges::greater{}, &RefutedNumber::moves);
}

void judge(Finding& f) {
  const auto is_class = [](const Cause& x) { return x.verdict == Verdict::kClass; };
  const auto is_inexact = [](const JointGain& g) { return g.extended > kInexact * g.torque_rms; };
  if (f.gain.after * f.gain.after > kUnseenNoise && f.gain.explained_share < kExplained &&
      std::ranges::any_of(f.joints, is_inexact))
    f.verdict = Verdict::kUnknown;
  else if (f.causes.empty())
    f.verdict = f.candidates.empty() ? Verdict::kNotIdentifiable : Verdict::kNone;
  else
    f.verdict = std::ranges::any_of(f.causes, is_class) ? Verdict::kClass : Verdict::kNamed;
}

/// Held-out runs by both models; the finding's model is the extended one then.
void simulate(const Limbs& limbs, const MotionData& data, const DiagnoseOptions& options,
              Finding& f) {
  Model before = f.model, after = f.model;
  bool alike = true;
  for (const auto& limb : limbs) {
    limb->robot().put(limb->base().model, before);
    limb->robot().put(limb->best().model, after);
    alike = alike && limb->best().terms.empty();
  }
  f.model = after;
  const HeldOutMotion motion =
      motion_of_stretches(data.test.empty() ? data.train : data.test, data.noise);
  const auto go_on = [&] {
    f.interrupted =
        f.interrupted || (options.progress && !options.progress({"simulating", 0, 0, 0.0}));
    return !f.interrupted;
  };
  f.simulated = simulate_held_out(before, after, alike, {motion, motion}, data.runs, go_on).motion;
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
  append(base.notes, finding.notes);

  std::vector<std::string> said_already;
  const MotionData data =
      motion_data(base.model, train, test, led_joints(base.model), said_already);
  for (const double noise : data.noise.position) finding.noise.push_back(noise);
  DiagnoseOptions shared = options;
  shared.progress = shared_progress(options.progress);
  const Limbs limbs = diagnoses(base, fit, data, train, test, shared);
  const std::size_t threads = static_cast<std::size_t>(std::max(options.threads, 1));
  parallel_for(limbs.size(), threads, [&](std::size_t k, std::size_t) { limbs[k]->search(); });
  keep_most(limbs, options.max_causes);
  parallel_for(limbs.size(), threads, [&](std::size_t k, std::size_t) { limbs[k]->describe(); });
  join(limbs, options, finding);
  note_described(model, base, finding);
  judge(finding);
  simulate(limbs, data, options, finding);
  finding.tried = std::ranges::all_of(limbs, [](const auto& limb) { return limb->tries_nothing(); })
                      ? Tried::kNothing
                      : Tried::kSome;  // no presliding
  finding.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return finding;
}

}  // namespace diffnea
