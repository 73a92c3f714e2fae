#include "diagnose/joint_diagnosis.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/posterior.hpp>
#include <diffnea/recording/audit.hpp>

#include "diagnose/base.hpp"
#include "diagnose/bounds.hpp"
#include "diagnose/evidence_plots.hpp"
#include "diagnose/grey_box.hpp"
#include "diagnose/next_experiment.hpp"
#include "diagnose/rows.hpp"
#include "diagnose/selection.hpp"
#include "diagnose/sentence.hpp"
#include "diagnose/simulated.hpp"
#include "diagnose/witness.hpp"

namespace diffnea {
namespace {

constexpr double kAbsorbedShare = 0.01;  ///< of a candidate's column that the base leaves
constexpr double kExplained = 0.8;       ///< below it, the cause is unknown
/// χ² of what is left over its degrees of freedom, where repeats tell the noise: 0.47 to 1.07 in
/// 139 recordings that hide nothing.
constexpr double kLeft = 1.3;

/// The effect that is looked for beyond the first band.
const std::string kGap = "backlash";

/// How far ln v₀ of the base's friction is followed from where it was read; beside a spring, which
/// the friction's jumps may wind up: their second derivative needs a v₀ that is no extrapolation.
constexpr double kMostTurn = 1.5, kMostTurnAtSpring = 0.7;
/// How often the base's friction is read anew.
constexpr int kTurnPasses = 3;

/// A reference whose torque moves by less leaves the candidates' columns as they are.
constexpr double kMoved = 0.003;

IdentifyOptions reading_options(const DiagnoseOptions& options) {
  IdentifyOptions out;
  out.preprocess = options.preprocess;
  out.progress = options.progress;
  return out;
}

std::vector<std::string> units_of(const Model& model) {
  std::vector<std::string> out;
  for (const int l : moving_links(model))
    out.push_back(model.links[static_cast<std::size_t>(l)].type == ModelJoint::kPrismatic ? "N"
                                                                                          : "N*m");
  return out;
}

/// Adds the time that it lived.
class Timer {
 public:
  explicit Timer(double& seconds) : seconds_(seconds) {}
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;
  ~Timer() {
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  double& seconds_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

class Diagnosis {
 public:
  Diagnosis(const Model& model, const RecordingSource& train, const RecordingSource* test,
            Band band, const DiagnoseOptions& options)
      : model_(model), train_source_(train), test_source_(test), options_(options), band_(band) {
    if (options.progress)
      options_.progress = [this, told = options.progress](const FitProgress& progress) {
        const bool go_on = told(progress);
        finding_.interrupted |= !go_on;
        return go_on;
      };
  }

  /// Verdict and causes; finish() adds what goes with them.
  const Finding& examine() {
    const Timer timer(finding_.seconds);
    prepare();
    select();
    describe();
    judge();
    return finding_;
  }

  /// @param stopped  a look beyond it was interrupted
  Finding finish(bool stopped = false) {
    {
      const Timer timer(finding_.seconds);
      finding_.interrupted |= stopped;
      if (finding_.verdict == Verdict::kUnknown && options_.grey_box && !finding_.interrupted)
        grey_ = grey_box(model_, *train_, *search_, terms_, *held_out_, witness_,
                         options_.accept_delta_bic);
      complete();
      plan_next();
      add_grey_box();
      finding_.plots = evidence_plots(finding_);
      finding_.sentence = sentence(finding_);
    }
    return std::move(finding_);
  }

  /// Whether there are frequencies beyond those that were looked at.
  bool wider() const { return wider_; }

 private:
  void prepare() {
    const bool posterior = model_.posterior && knows_arm(*model_.posterior);
    base_ = options_.base != Base::kAuto ? options_.base : posterior ? Base::kPrior : Base::kRefit;
    if (base_ == Base::kPrior && !posterior)
      throw ModelError(
          "--base prior: " + (model_.source.empty() ? "the model" : model_.source) +
          " has no posterior; give the model.json that `identify` wrote, or take --base refit");
    finding_.base = base_ == Base::kRefit ? "refit" : base_ == Base::kPrior ? "prior" : "fixed";
    FitChoice choice;
    choice.effects = std::vector<std::string>{};
    layout_ = layout_for(model_, train_source_, test_source_, choice, finding_.notes);
    const IdentifyOptions reading = reading_options(options_);
    const std::vector<Recording> sample = train_source_.sample();
    link_side_ = sample.front().info.torque_side == TorqueSide::kLink;
    const AuditReport report = audit(sample, {.joints = describe_joints(model_)});
    finding_.audit = report.faults;
    period_ = sample.front().info.period;
    if (period_ <= 0.0 && !report.periods.empty()) period_ = report.periods.front().seconds;
    candidates_ = make_candidates(model_, options_.effects, train_source_.runs(), link_side_);
    const RowsPlan rows = plan_rows(model_, sample, period_, band_, options_.preprocess);
    finding_.plan = rows.plan;
    wider_ = rows.wider;
    finding_.data_report = train_source_.report();
    period_ = finding_.plan.dt * std::round(period_ / finding_.plan.dt);
    const auto read_train = [&] {
      train_ = std::make_unique<Evidence>(model_, layout_, train_source_, finding_.plan, period_,
                                          reading);
    };
    read_train();
    require_motion(*train_, finding_.plan, sample.front().source);
    if (const std::string held = base_ == Base::kRefit ? hold_scale(*train_, layout_) : "";
        !held.empty())
      finding_.notes.push_back("All torques are zero, which leaves the scale of all masses open: " +
                               held + " is held at the model's value.");
    for (int pass = 0; pass < kTurnPasses && fit_turns(base_, *train_, layout_); ++pass)
      read_train();
    if (!train_->averaged()) period_ = 0.0;  // does not repeat well enough
    if (test_source_) {
      const std::vector<Recording> held = test_source_->sample();
      test_plan_ = plan_held_out(held, finding_.plan, options_.preprocess);
      double period = held.front().info.period;
      if (period <= 0.0) period = detect_period(held.front()).seconds;
      if (period <= 0.0) period = period_;  // checked where it is used
      const double dt = test_plan_.dt;
      test_ = std::make_unique<Evidence>(model_, layout_, *test_source_, test_plan_,
                                         dt * std::round(period / dt), reading,
                                         static_cast<int>(train_source_.runs().size()));
      finding_.held_out = "test recording";
    } else {
      split_in_time(*train_, fitted_rows_, held_rows_);
      finding_.held_out = "time blocks";
    }
    add_own_candidates(options_.candidates, model_, candidates_);
    for (const Candidate& c : candidates_)
      if (c.effect.own)
        for (Evidence* e : {train_.get(), test_.get()})
          if (e) e->evaluate(*c.effect.own);
    finding_.refused =
        bound_shapes(*train_, layout_, finding_.plan.q_noise,
                     train_->averaged() && (!test_ || test_->averaged()), candidates_);
    prior_ = base_prior(base_, model_, layout_, *train_);
    const Whitener white(*train_, white_noise(*train_), fitted_rows_);
    set_reference(Projection(*train_, white, prior_).reference(VecX<double>::Zero(train_->rows())),
                  {});
    held_out_ = std::make_unique<HeldOut>(test_ ? *test_ : *train_, held_rows_, options_.seed);
    search_ = std::make_unique<Search>(*train_, candidates_, prior_, fitted_rows_);
    std::vector<Term> none;
    search_->refresh(period_, none);
  }

  /// The base model at parameters x, that go with these causes.
  Model base_at(const VecX<double>& x, const std::vector<Term>& terms) const {
    const bool spring = std::ranges::any_of(
        terms, [](const Term& t) { return t.effect.info().name == "joint_elasticity"; });
    const double most = spring ? kMostTurnAtSpring : kMostTurn;
    const long linear = static_cast<long>(layout_.linear.size());
    VecX<double> shape(static_cast<long>(layout_.shape.size()));
    long at = linear;
    for (std::size_t s = 0; s < layout_.shape.size(); ++s) {
      shape[static_cast<long>(s)] = layout_.shape[s].prior;
      if (is_smoothing(layout_.shape[s]))
        shape[static_cast<long>(s)] *= std::exp(std::clamp(x[at++], -most, most));
    }
    VecX<double> physical = x.head(linear);
    for (std::size_t k = 0; k < layout_.linear.size(); ++k)  // the test's base knows no bounds
      if (layout_.linear[k].sign != Sign::kFree && !layout_.linear[k].fixed)
        physical[static_cast<long>(k)] = std::max(physical[static_cast<long>(k)], 0.0);
    return apply_fit(model_, layout_, physical, shape);
  }

  /// The model whose torques effects refer to: base parameters x and the causes so far.
  /// @return by which share a joint's torque moved, the largest of all
  double set_reference(const VecX<double>& x, const std::vector<Term>& terms) {
    Model reference = base_at(x, terms);
    finding_.model = reference;
    for (const Term& t : terms) {
      if (t.effect.own) continue;  // no model can hold it
      finding_.model.effects.push_back(to_spec(t.effect));
      // Those that change the tree or the channels are columns of their own on top of it; under a
      // tilt are the base's columns, too.
      if (t.effect.is_local() || t.effect.info().name == "base_tilt")
        reference.effects.push_back(to_spec(t.effect));
    }
    const double moved = train_->set_reference(reference);
    if (test_) test_->set_reference(reference);
    return moved;
  }

  /// The reference beside the causes so far. A delay is a share of the torque that the model
  /// predicts: it is as wrong as that torque.
  bool rebase(const std::vector<Term>& terms) {
    VecX<double> effects = VecX<double>::Zero(train_->rows());
    for (const Term& t : terms) effects += t.torque();
    const VecX<double> x = search_->projection().reference(effects);
    const bool moved = set_reference(x, terms) > kMoved;
    return set_tilt(x, terms) || moved;
  }

  /// Under a tilt that is among the causes, the base's columns are those of the tilted base.
  bool set_tilt(const VecX<double>& x, const std::vector<Term>& terms) {
    Vec3<double> more{0, 0, 0};
    for (const Term& t : terms)
      if (t.effect.info().name == "base_tilt")
        more = more + Vec3<double>{t.effect.parameters[0], t.effect.parameters[1], 0.0};
    if (!tilted_ && dot(more, more) == 0.0) return false;
    tilted_ = dot(more, more) > 0.0;
    train_->set_tilt(more, x);
    if (test_) test_->set_tilt(more, x);
    return true;
  }

  void select() {
    const int most =
        options_.max_causes > 0 ? options_.max_causes : std::max(8, 3 * layout_.num_dofs);
    Selection selection(*search_, candidates_, *held_out_,
                        {options_.accept_delta_bic, most, period_,
                         [this](const std::vector<Term>& terms) { return rebase(terms); }});
    first_scores_ = search_->scores({});
    level_sum_ = search_->residual_sum();
    terms_ = selection.run([this](const FitProgress& progress) {
      finding_.interrupted = options_.progress && !options_.progress(progress);
      return !finding_.interrupted;
    });
    if (static_cast<int>(terms_.size()) >= most)
      finding_.notes.push_back("stopped at " + std::to_string(most) +
                               " causes; the model may lack more");
    for (const Refusal& r :
         selection.refused()) {  // the last word on each that was not accepted after all
      const auto same = [&](const auto& other) {
        return other.effect == r.effect && other.where == r.where;
      };
      std::erase_if(finding_.refused, same);
      finding_.refused.push_back(r);
    }
    for (const Term& t : terms_)
      std::erase_if(finding_.refused, [&](const Refusal& r) {
        return r.effect == t.effect.info().name && r.where == t.effect.where;
      });
    if (!terms_.empty()) {
      finding_.causes = selection.causes(terms_);
    }
  }

  void describe() {
    for (const Score& s : first_scores_) {
      const Candidate& c = candidates_[static_cast<std::size_t>(s.candidate)];
      const std::string& name = c.effect.info().name;
      if (s.visible_share < kAbsorbedShare && s.visible_share > 0.0)
        finding_.absorbed.push_back({name, c.effect.where, s.visible_share});
      if (s.variant >= 0)
        finding_.candidates.push_back(
            {name, c.effect.where, s.delta_bic, s.gain, s.visible_share, {}});
    }
    for (const JointNoise& n : search_->whitener().noise()) finding_.noise.push_back(n.rms);
    // Is there anything to explain? The best of all candidates, as many times as there were trials.
    const double best = first_scores_.empty() || first_scores_.front().variant < 0
                            ? 0.0
                            : first_scores_.front().gain;
    finding_.lack_of_fit_p = std::min(1.0, static_cast<double>(first_scores_.size()) *
                                               std::erfc(std::sqrt(std::max(best, 0.0) / 2.0)));
    const std::vector<std::string> names = joint_names(model_);
    witness_ =
        find_witnesses(*train_, *search_, terms_, *held_out_, names, options_.accept_delta_bic);
    for (const WitnessScore& w : witness_)
      finding_.witness.push_back(
          {names[static_cast<std::size_t>(w.joint)], w.variables, w.share, w.delta_bic});

    const VecX<double> e0 = held_out_->errors(*search_, {}),
                       e1 = held_out_->errors(*search_, terms_);
    const HeldOutChange change =
        held_out_->compare(held_out_->whitened(*search_, e0), held_out_->whitened(*search_, e1));
    double more = 0.0;  // that smooth functions of the motion would still remove
    for (const WitnessScore& w : witness_)
      more += std::max(0.0, w.held_out.before - w.held_out.after);
    const double freedom =
        static_cast<double>(std::max<long>(search_->rows() - search_->projection().rank(), 1));
    // Under a tilt the base's columns are no longer those of the base alone.
    finding_.lack_of_fit = (tilted_ ? level_sum_ : search_->residual_sum()) / freedom;
    misfit_ = search_->noise_is_repeatable() &&
              (search_->residual_sum() - search_->gain_of(terms_)) / freedom > kLeft;
    double floor = std::max(change.after - more, 0.0);
    if (misfit_) floor = std::min(floor, 1.0);
    finding_.gain = gain_of(change, floor);
    for (Cause& c : finding_.causes) c.gain.noise_floor = finding_.gain.noise_floor;
  }

  /// Errors, parameters and motion of the extended model.
  void complete() {
    const bool grey = !grey_.joints.empty();
    const VecX<double> e0 = held_out_->errors(*search_, {});
    const VecX<double> e1 =
        grey ? held_out_->errors_with(*search_, terms_, grey_.torque.there, grey_.torque.here)
             : held_out_->errors(*search_, terms_);
    if (grey) {
      const HeldOutChange change =
          held_out_->compare(held_out_->whitened(*search_, e0), held_out_->whitened(*search_, e1));
      const double floor = finding_.gain.noise_floor * finding_.gain.noise_floor;
      finding_.gain = gain_of(change, std::min(floor, change.after));
    }
    add_series(e0, e1);
    note_offsets(e1);
    LinearFit fit;
    const VecX<double> x =
        final_base(base_, layout_, *search_, *train_, terms_, grey_.torque.there, fit);
    if (base_ == Base::kRefit) {
      VecX<double> shape(static_cast<long>(layout_.shape.size()));
      for (std::size_t k = 0; k < layout_.shape.size(); ++k)
        shape[static_cast<long>(k)] = layout_.shape[k].prior;
      finding_.parameters = parameter_estimates(layout_, fit.x, shape, fit.std, fit.identifiable,
                                                fit.solver.active_nonnegative);
    }
    set_reference(x, terms_);
    for (const Remainder& r : grey_.joints) finding_.model.effects.push_back(to_spec(r.effect));
    if (!finding_.interrupted) simulate(x);
  }

  /// @param x  the base parameters that go with the causes
  void simulate(const VecX<double>& x) {
    for (const Term& t : terms_)
      if (t.effect.own) {
        finding_.simulated.reason =
            "the extended model cannot hold the candidate " + t.effect.own->name;
        finding_.notes.push_back("the extended model lacks " + t.effect.own->name + " at " +
                                 t.effect.where +
                                 ": model files hold effects of the catalogue alone");
      }
    if (!finding_.simulated.reason.empty()) return;
    LinearFit fit;
    const VecX<double> alone =
        terms_.empty() ? x : final_base(base_, layout_, *search_, *train_, {}, {}, fit);
    finding_.simulated =
        simulate_held_out(base_at(alone, {}), finding_.model, test_ ? *test_source_ : train_source_,
                          held_out_->evidence(), held_rows_, test_ ? test_plan_ : finding_.plan,
                          reading_options(options_));
  }

  /// Only where something is left to tell apart: it takes a few seconds.
  void plan_next() {
    if (finding_.interrupted ||
        std::ranges::all_of(finding_.causes, [](const Cause& c) { return c.members.empty(); }))
      return;
    Model reference = finding_.model;
    reference.effects.resize(reference.effects.size() - terms_.size() -
                             grey_.joints.size());  // the causes come last
    try {
      finding_.next_experiment =
          next_experiment({model_, reference, layout_, prior_, finding_.plan, train_->joints(),
                           search_->whitener().noise(), link_side_, candidates_, terms_,
                           finding_.causes, options_.seed});
    } catch (const Error& error) {
      finding_.notes.push_back(std::string("no next experiment is proposed: ") + error.what());
    }
  }

  void add_grey_box() {
    for (const Remainder& r : grey_.joints) {
      finding_.grey_box.push_back(r.description);
      finding_.causes.push_back(r.cause);
      finding_.causes.back().gain.noise_floor = finding_.gain.noise_floor;
    }
    for (const Refusal& r : grey_.refused) finding_.refused.push_back(r);
  }

  /// What changed between the recordings is no cause of the fitted one.
  void note_offsets(const VecX<double>& errors) {
    if (!test_) return;
    const std::vector<std::string> names = joint_names(model_), units = units_of(model_);
    for (const HeldOutOffset& o : held_out_->offsets(errors))
      finding_.notes.push_back(
          names[static_cast<std::size_t>(o.joint)] + ": on held-out data the torque is off by " +
          format_number(o.mean) + " ± " + format_number(1.96 * o.std) + " " +
          units[static_cast<std::size_t>(o.joint)] + " while it moves, " +
          format_number(std::round(100.0 * o.share)) +
          " % of what is left: its offset changed between the recordings; give both as DATA to "
          "have it fitted (session_offset)");
  }

  void add_series(const VecX<double>& e0, const VecX<double>& e1) {
    const Evidence& e = held_out_->evidence();
    const std::vector<std::string> names = joint_names(model_), units = units_of(model_);
    for (std::size_t k = 0; k < e.joints().size(); ++k) {
      const int j = e.joints()[k];
      const long begin = static_cast<long>(k) * e.times();
      ResidualSeries s;
      s.joint = names[static_cast<std::size_t>(j)];
      s.unit = units[static_cast<std::size_t>(j)];
      JointGain g{s.joint, s.unit, 0.0, 0.0, 0.0, search_->whitener().noise()[k].rms};
      double rows = 0.0;
      for (long i = 0; i < e.times(); ++i) {
        const long row = begin + i;
        if (!held_rows_.empty() && !held_rows_[static_cast<std::size_t>(row)]) continue;
        s.time.push_back(e.time()[static_cast<std::size_t>(i)]);
        const double measured = e.torque()[row] - (e.shift().size() > 0 ? e.shift()[row] : 0.0);
        s.measured.push_back(measured);
        s.base.push_back(measured - e0[row]);
        s.extended.push_back(measured - e1[row]);
        s.q.push_back(e.q()(i, j));
        s.qd.push_back(e.qd()(i, j));
        s.qdd.push_back(e.qdd()(i, j));
        g.torque_rms += measured * measured;
        g.base += e0[row] * e0[row];
        g.extended += e1[row] * e1[row];
        ++rows;
      }
      for (double* v : {&g.torque_rms, &g.base, &g.extended})
        *v = std::sqrt(*v / std::max(rows, 1.0));
      finding_.joints.push_back(g);
      finding_.series.push_back(std::move(s));
    }
  }

  void judge() {
    Finding& f = finding_;
    const bool ambiguous =
        std::ranges::any_of(f.causes, [](const Cause& c) { return c.verdict == Verdict::kClass; });
    if ((misfit_ || !f.witness.empty()) && f.gain.explained_share < kExplained)
      f.verdict = Verdict::kUnknown;
    else if (f.causes.empty())
      f.verdict = f.candidates.empty() ? Verdict::kNotIdentifiable : Verdict::kNone;
    else
      f.verdict = ambiguous ? Verdict::kClass : Verdict::kNamed;
  }

  const Model& model_;
  const RecordingSource& train_source_;
  const RecordingSource* test_source_;
  DiagnoseOptions options_;
  Band band_;
  bool wider_ = false;
  Finding finding_;
  Base base_ = Base::kRefit;
  FitLayout layout_;
  std::vector<Candidate> candidates_;
  double period_ = 0.0;
  PreprocessPlan test_plan_;
  bool link_side_ = false;
  bool tilted_ = false;
  double level_sum_ = 0.0;  ///< χ² of the base alone, before any cause
  bool misfit_ = false;     ///< more than noise is left
  std::vector<bool> fitted_rows_, held_rows_;
  BasePrior prior_;
  std::unique_ptr<Evidence> train_, test_;
  std::unique_ptr<HeldOut> held_out_;
  std::unique_ptr<Search> search_;
  std::vector<Score> first_scores_;
  std::vector<Term> terms_;
  std::vector<WitnessScore> witness_;
  GreyBoxResult grey_;
};

/// Where nothing was found, a gap is looked for in the wider band: there the positions' noise, as a
/// torque, drowns any smooth effect, but a step of a position has as wide a spectrum. It has to be
/// the only cause, beside all candidates.
Finding with_gap_beyond(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options,
                        Finding narrow) {
  DiagnoseOptions gaps = options;
  gaps.candidates.clear();
  if (options.effects.empty()) gaps.effects = {kGap};
  std::erase_if(gaps.effects, [](const std::string& e) { return !e.starts_with(kGap); });
  if (gaps.effects.empty()) return narrow;
  gaps.grey_box = false;
  const Finding screened = Diagnosis(model, train, test, Band::kWide, gaps).examine();
  narrow.seconds += screened.seconds;
  narrow.interrupted |= screened.interrupted;
  if (narrow.interrupted || screened.causes.empty()) return narrow;
  Diagnosis again(model, train, test, Band::kWide, options);
  const Finding& seen = again.examine();
  narrow.interrupted |= seen.interrupted;
  if (seen.interrupted || seen.causes.empty() ||
      std::ranges::any_of(seen.causes, [](const Cause& c) { return c.effect != kGap; }))
    return narrow;
  Finding wide = again.finish();
  wide.seconds += narrow.seconds;
  wide.notes.push_back("up to " + format_number(narrow.plan.filter_hz) +
                       " Hz nothing was left to explain: the gap shows up to " +
                       format_number(wide.plan.filter_hz) + " Hz");
  return wide;
}

}  // namespace

Finding diagnose_joints(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options) {
  Diagnosis narrow(model, train, test, Band::kInformative, options);
  const Finding& first = narrow.examine();
  if (first.interrupted || !narrow.wider()) return narrow.finish();
  if (first.verdict == Verdict::kNone)
    return with_gap_beyond(model, train, test, options, narrow.finish());
  if (first.verdict != Verdict::kUnknown) return narrow.finish();
  // A stiff loop keeps what is fast out of the positions, not out of the torques.
  Diagnosis wide(model, train, test, Band::kWide, options);
  const Finding& second = wide.examine();
  const bool says_more = second.verdict != Verdict::kUnknown ||
                         (first.witness.empty() && !second.witness.empty()) ||
                         second.gain.explained_share > first.gain.explained_share;
  if (second.interrupted || !says_more) return narrow.finish(second.interrupted);
  Finding finding = wide.finish();
  finding.seconds += first.seconds;
  finding.notes.push_back("up to " + format_number(first.plan.filter_hz) +
                          " Hz no effect of the catalogue explained the error: looked at up to " +
                          format_number(finding.plan.filter_hz) + " Hz");
  return finding;
}

}  // namespace diffnea
