#include "diagnose/joint_case.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/identify/posterior.hpp>
#include <diffnea/recording/audit.hpp>

#include "diagnose/base.hpp"
#include "diagnose/bounds.hpp"
#include "identify/ball_identify.hpp"
#include "identify/fingerprint.hpp"
#include "identify/passes.hpp"
#include "identify/torque_notes.hpp"

namespace diffnea {
namespace {

/// How often the rows are read anew, about a better base.
constexpr int kBasePasses = 3;

/// Whether some of the recordings are among those that the posterior was made of.
bool is_made_of(const Posterior& posterior, const RecordingSource& source) {
  return std::ranges::any_of(fingerprints(source), [&](const std::string& of) {
    return std::ranges::find(posterior.recordings, of) != posterior.recordings.end();
  });
}

/// Held-out rows are stacked by joint, as the fitted ones are.
void require_same_joints(const std::vector<std::string>& names, const Evidence& train,
                         const Evidence& test, const std::string& source) {
  const auto known = [&](const Evidence& e) {
    std::string out;
    for (const int j : e.joints()) out += (out.empty() ? "" : ", ") + names[j];
    return out;
  };
  if (train.joints() != test.joints())
    throw DataError(source + ": the held-out torques are those of " + known(test) +
                    ", expected those of the fitted recording: " + known(train) +
                    "; give both the same `tau_` columns and the same `passive` joints");
}

/// A fit of nothing at a floating base's coordinates: there are neither links nor joints.
/// @param joints  how many of these lead
FitChoice without_base_joints(const JointCase& c, int joints) {
  FitChoice out;
  for (int k = 0; k < joints; ++k) out.fix.push_back(joint_names(c.model)[k] + ".*");
  return out;
}

/// Moves what the rows are linear about to a fit of them. Links and the instants at which friction
/// turns are fitted beside rotors and friction that files often lack, as `identify` does.
/// @return whether rows are to be read anew
bool fit_linearisation(JointCase& c, const IdentifyOptions& reading) {
  const auto turn = [&](const Evidence& evidence, FitLayout& layout, VecX<double>& early) {
    return fit_turns(c.base, evidence, evidence.torque(), layout, early);
  };
  VecX<double> early = c.about.early;
  Model links = c.about.links;
  bool moved = false;
  std::vector<std::string> notes;
  FitLayout usual;
  if (c.base == Base::kRefit && c.train->driven())
    usual = layout_for(c.model, c.train_source, c.test_source,
                       without_base_joints(c, c.base_joints()), notes);
  if (usual.linear.size() > c.layout.linear.size()) {
    const Evidence evidence(c.model, c.about, usual, c.train_source, c.finding.plan, c.period,
                            reading, 0, nullptr, c.base_joints());
    links = refitted(c.base, c.model, usual, evidence);
    VecX<double> of_own = early;
    moved = turn(*c.train, c.layout, of_own);
    moved |= turn(evidence, usual, early);
  } else {
    if (c.train->driven()) links = refitted(c.base, c.model, c.layout, *c.train);
    moved = turn(*c.train, c.layout, early);
  }
  c.about.early = early;
  if (is_heavier(links, c.about.links, *c.train)) {
    c.about.links = std::move(links);
    moved = true;
  }
  return moved;
}

AuditReport audit_logged(const JointCase& c, const RecordingSource& source) {
  std::vector<JointDescription> joints = describe_joints(c.model);
  joints.erase(joints.begin(), joints.begin() + c.base_joints());
  return audit(source.sample(), {.joints = std::move(joints)});
}

/// Faults of held-out channels bias what is said of them; there is no end of notes on clocks.
void audit_held_out(JointCase& c) {
  const RecordingSource& source = c.floats ? *c.floats->logged_test() : *c.test_source;
  for (ChannelFault& fault : audit_logged(c, source).faults) {
    if (fault.severity != FaultSeverity::kFault) continue;
    fault.evidence.insert(0, "held-out data: ");
    c.finding.audit.push_back(std::move(fault));
  }
}

/// Root mean square of what a joint's torque changes by from one row of the log to the next.
double change_of(const std::vector<Recording>& sample, std::size_t joint) {
  double squares = 0.0, count = 0.0;
  for (const Recording& r : sample)
    for (long i = 1; i < r.rows(); ++i) {
      const double change = r.tau(i, joint) - r.tau(i - 1, joint);
      if (std::isfinite(change)) squares += change * change, ++count;
    }
  return std::sqrt(squares / std::max(count, 1.0));
}

/// Where noise is more than half of a torque's power, nothing that is left of it says anything.
/// @throws DataError if it is so at every joint
void require_torque(JointCase& c) {
  const Evidence& held = c.held_out->evidence();
  const std::vector<JointNoise>& noises = c.search->whitener().noise();
  const std::vector<bool> of_held = c.held_out->whitener(*c.search).kept();
  const VecX<double> left = c.held_out->errors(*c.search, {});
  const std::string fitted = c.train_source.sample().front().source,
                    held_out = c.test ? c.test_source->sample().front().source : fitted;
  std::vector<std::string> drowned;
  std::size_t driven = 0, of_fitted = 0;
  for (std::size_t k = 0; k < noises.size(); ++k) {
    if (c.train->passive(k)) continue;
    ++driven;
    const int j = c.train->joints()[k];
    const std::string unit = " " + unit_of_joint(c.model, j, true);
    const auto look = [&](double noise, double torque, const RecordingSource& source,
                          const std::string& rows) {
      if (!(torque > 0.0) || !(2.0 * noise * noise > torque * torque)) return false;
      drowned.push_back(joint_names(c.model)[j] + ": noise of " + format_number(noise) + unit +
                        " in a torque of " + format_number(torque) + unit + ", which changes by " +
                        format_number(change_of(source.sample(), j)) + unit +
                        " from one row to the next (" + rows + ")");
      return true;
    };
    const double of_signals =
        c.test ? std::min(held.signal_noise(k), held.rms(k, left, of_held)) : 0.0;
    if (look(noises[k].rms, c.train->rms(k, c.train->torque(), c.search->whitener().kept()),
             c.train_source, "fitted rows of " + fitted))
      ++of_fitted;
    else
      look(std::max(noises[k].rms, of_signals), held.rms(k, held.torque(), of_held),
           c.test ? *c.test_source : c.train_source, "held-out rows of " + held_out);
  }
  if (drowned.empty()) return;
  const std::string why =
      "noise is more than half of the torque's power, so that nothing can be said of it: " +
      detail::join(drowned, "; ") +
      ". Neither the model nor any smooth function of the motion explains it: is the column the "
      "torque, true all along (no limit, no touch, no drive switched off)? If it changes as much "
      "from row to row, log "
      "faster; else record faster motion";
  if (drowned.size() == driven)
    throw DataError((of_fitted > 0 ? fitted : held_out) + ": diagnose: " + why);
  c.drowned = true;
  c.finding.notes.push_back(kWarning + why);
}

}  // namespace

IdentifyOptions reading_options(const DiagnoseOptions& options) {
  IdentifyOptions out;
  out.preprocess = options.preprocess;
  out.progress = options.progress;
  return out;
}

void prepare(JointCase& c) {
  const bool posterior = c.model.posterior && knows_arm(*c.model.posterior);
  c.base = c.options.base != Base::kAuto ? c.options.base : posterior ? Base::kPrior : Base::kRefit;
  if (c.base == Base::kPrior && c.options.base == Base::kAuto &&
      std::ranges::none_of(c.model.posterior->recordings, [](const std::string& recording) {
        return recording.starts_with(kOfMotion);
      }))
    c.finding.notes.push_back(
        "the model does not say which recordings it was identified from (an earlier version wrote "
        "it): if from this one, take --base refit");
  if (c.base == Base::kPrior && c.options.base == Base::kAuto &&
      is_made_of(*c.model.posterior, c.train_source)) {
    c.base = Base::kRefit;
    c.finding.notes.push_back(
        "the model was identified from this recording: its parameters are fitted again (--base "
        "refit), since what the recording tells does not count twice, and what the model lacks has "
        "bent them");
  }
  if (c.base == Base::kPrior && !posterior)
    throw ModelError(
        "--base prior: " + (c.model.source.empty() ? "the model" : c.model.source) +
        " has no posterior; give the model.json that `identify` wrote, or take --base refit");
  c.finding.base = c.base == Base::kRefit ? "refit" : c.base == Base::kPrior ? "prior" : "fixed";
  // The last of a base's joints moves the base itself, which has parameters.
  FitChoice choice = without_base_joints(c, std::max(c.base_joints() - 1, 0));
  choice.effects = std::vector<std::string>{};
  c.layout = layout_for(c.model, c.train_source, c.test_source, choice, c.finding.notes);
  const IdentifyOptions reading = reading_options(c.options);
  const std::vector<Recording> sample = c.train_source.sample();
  c.link_side = sample.front().info.torque_side == TorqueSide::kLink;
  const AuditReport report = audit_logged(c, c.floats ? c.floats->logged_train() : c.train_source);
  c.finding.audit = report.faults;
  c.period = sample.front().info.period;
  if (c.period <= 0.0 && !report.periods.empty()) c.period = report.periods.front().seconds;
  c.finding.data_report = c.train_source.report();
  for (std::size_t s = 0; s < c.about.widths.size(); ++s)
    c.layout.shape[s].prior = c.about.widths[s];
  const auto read_train = [&] {
    c.finding.plan = plan_rows(c.about.links, sample, c.period, c.options.preprocess);
    c.period = c.finding.plan.dt * std::round(c.period / c.finding.plan.dt);
    c.train = std::make_unique<Evidence>(c.model, c.about, c.layout, c.train_source, c.finding.plan,
                                         c.period, reading, 0, nullptr, c.base_joints());
  };
  read_train();
  require_motion(*c.train, c.finding.plan, sample);
  if (const std::string held = c.base == Base::kRefit ? hold_scale(*c.train, c.layout) : "";
      !held.empty())
    c.finding.notes.push_back("All torques are zero, which leaves the scale of all masses open: " +
                              held + " is held at the model's value.");
  for (int pass = 0; pass < kBasePasses && c.about.widths.empty(); ++pass) {
    if (!fit_linearisation(c, reading)) break;
    read_train();
  }
  const std::vector<std::string> followers = follower_names(c.model);
  for (const ChannelWarning& w : c.train_source.warnings())  // others are the audit's
    if (std::ranges::find(followers, w.joint) != followers.end()) c.finding.notes.push_back(w.text);
  for (const int j : c.train->resting())
    c.finding.notes.push_back(joint_names(c.model)[j] +
                              " stands still: friction may hold it whatever its torque is, which "
                              "is left out, as are causes that act there");
  for (const int j : c.train->sticking())
    c.finding.notes.push_back(joint_names(c.model)[j] +
                              " sticks wherever it turns back: its turns are left out, and what "
                              "shows there alone (Stribeck friction, gaps, springs that friction "
                              "winds up) may be missed");
  if (!c.train->repeats()) c.period = 0.0;  // does not repeat well enough
  if (c.test_source) {
    const std::vector<Recording> held = c.test_source->sample();
    require_blocks(held);
    audit_held_out(c);
    c.test_plan = plan_held_out(held, c.finding.plan, c.options.preprocess);
    double period = held.front().info.period;
    if (period <= 0.0) period = detect_period(held.front()).seconds;
    if (period <= 0.0) period = c.period;  // checked where it is used
    const double dt = c.test_plan.dt;
    c.test = std::make_unique<Evidence>(
        c.model, c.about, c.layout, *c.test_source, c.test_plan, dt * std::round(period / dt),
        reading, static_cast<int>(c.train_source.runs().size()), c.train.get(), c.base_joints());
    require_same_joints(joint_names(c.model), *c.train, *c.test, held.front().source);
    require_blocks(*c.test, held);
    require_motion(*c.test, c.test_plan, held);
    note_band(c.finding.plan, c.test_plan, c.finding.notes);
    for (const std::string& note : c.test_source->report().notes)
      c.finding.data_report.notes.push_back("held-out data: " + note);
    c.finding.held_out = "test recording";
  } else {
    split_in_time(*c.train, c.fitted_rows, c.held_rows);
    c.finding.held_out = "time blocks";
  }
  if (c.options.whole_catalogue() || !c.options.effects.empty())
    c.candidates = make_candidates(c.model, c.about.links, c.options.effects, c.train_source.runs(),
                                   c.link_side, c.base_joints());
  add_own_candidates(c.options.candidates, c.model, c.candidates);
  for (const Candidate& tried : c.candidates)
    if (tried.effect.own)
      for (Evidence* e : {c.train.get(), c.test.get()})
        if (e) e->evaluate(tried.effect);
  c.finding.refused =
      bound_shapes(*c.train, c.layout, c.finding.plan,
                   c.train->halves() && (!c.test || c.test->halves()), c.candidates);
  tell_flights(c.candidates);
  c.prior = base_prior(c.base, c.model, c.layout, *c.train);
  const Whitener white(*c.train, white_noise(*c.train), c.fitted_rows);
  c.reference = std::make_unique<Reference>(c.model, c.layout, *c.train, c.test.get());
  c.reference->set(
      Projection(*c.train, white, c.prior).reference(VecX<double>::Zero(c.train->rows())), {});
  c.held_out = std::make_unique<HeldOut>(c.test ? *c.test : *c.train, c.held_rows, c.options.seed);
  c.search = std::make_unique<Search>(*c.train, c.candidates, c.prior, c.fitted_rows);
  std::vector<Term> none;
  c.search->refresh(c.period, none);
  // Beside a ball that was seen, an arm of which nothing can be said is no reason to stop.
  if (c.search->blind().size() == c.train->joints().size() &&
      (!c.model.ball || recordings_with_ball(c.train_source).empty()))
    throw DataError(sample.front().source + ": diagnose: " +
                    format_number(static_cast<double>(c.train->times()) * c.train->step()) +
                    " s of fitted rows are too few to tell noise from what the model lacks, at "
                    "every joint; record ten seconds or more, or a motion that repeats");
  require_torque(c);
  for (const long k : c.search->blind())
    c.finding.notes.push_back(
        joint_names(c.model)[c.train->joints()[k]] +
        ": too few rows to tell noise from what the model lacks, which stays hidden; record "
        "longer, or a motion that repeats");
}

}  // namespace diffnea
