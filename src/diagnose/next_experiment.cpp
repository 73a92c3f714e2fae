#include "diagnose/next_experiment.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>

#include "diagnose/experiment_trial.hpp"
#include "diagnose/thresholds.hpp"
#include "excite/motion.hpp"

namespace diffnea {
namespace {

constexpr double kPeriod = 10.0;         ///< of the motions [s]
constexpr double kRamp = 0.1;            ///< from rest to the velocity limit: fast motions need it
constexpr int kSamplesPerHarmonic = 12;  ///< for limits

/// A kind of motion: which harmonics of 1/kPeriod, and how much of the limits.
struct Family {
  const char* words;
  int first, last;         ///< harmonics
  double speed = 1.0;      ///< of the velocity limit
  double range = 1.0;      ///< of the position limits
  bool one_joint = false;  ///< at the cause's joints alone; the others move in the ordinary way
};

const std::vector<Family> kFamilies{
    {"in five harmonics up to 0.5 Hz", 1, 5},
    {"slowly, up to 0.3 Hz, over its whole range", 1, 3, 1.0, 1.2},
    {"slowly, at a tenth of its speed", 1, 3, 0.1},
    {"at up to 1 Hz", 1, 10},
    {"between 0.8 and 1.2 Hz", 8, 12},
    {"at up to 3 Hz", 1, 30},
    {"between 1.8 and 2.2 Hz", 18, 22},
    {"between 2.5 and 3 Hz", 25, 30},
    {"at up to 5 Hz", 1, 50},
    {"between 4 and 5 Hz", 40, 50},
    {"between 0.8 and 1.2 Hz", 8, 12, 1.0, 1.0, true},
    {"at up to 3 Hz", 1, 30, 1.0, 1.0, true},
    {"between 2.5 and 3 Hz", 25, 30, 1.0, 1.0, true},
    {"at up to 5 Hz", 1, 50, 1.0, 1.0, true},
};
constexpr int kOrdinaryLast = 5;
constexpr int kDraws = 2;  ///< of each family

/// Coefficients in a band that begin at rest: Σ k a_k = Σ k² b_k = 0.
void draw_band(int first, int last, Rng& rng, Eigen::Ref<VecX<double>> a,
               Eigen::Ref<VecX<double>> b) {
  a.setZero();
  b.setZero();
  VecX<double> k = VecX<double>::Zero(a.size());
  for (int i = first; i <= last; ++i) {
    k[i - 1] = i;
    a[i - 1] = rng.normal() / i;
    b[i - 1] = rng.normal() / i;
  }
  const VecX<double> k2 = k.cwiseAbs2();
  a -= k * (k.dot(a) / k.squaredNorm());
  b -= k2 * (k2.dot(b) / k2.squaredNorm());
}

std::string label(const std::string& effect, const std::string& where) {
  std::string out = effect + " at " + where;
  std::ranges::replace(out, '_', ' ');
  return out;
}

class Proposal {
 public:
  explicit Proposal(const ExperimentContext& c) : c_(c), effort_(c.reference) {
    const bool all_small =
        std::ranges::none_of(c.causes, [](const Cause& x) { return x.share >= kWorthWords; });
    for (std::size_t i = 0; i < c.causes.size(); ++i) {
      if (!all_small && !(c.causes[i].share >= kWorthWords)) continue;
      const auto term = std::ranges::find_if(c.terms, [&](const Term& t) {
        return t.effect.info().name == c.causes[i].effect && t.effect.where == c.causes[i].where;
      });
      for (const Rival& r : c.causes[i].members) {
        const auto rival = std::ranges::find_if(c.candidates, [&](const Candidate& x) {
          return x.effect.info().name == r.effect && x.effect.where == r.where;
        });
        if (term != c.terms.end() && rival != c.candidates.end())
          pairs_.push_back(
              {static_cast<std::size_t>(term - c.terms.begin()), &*rival, r.delta_bic});
      }
    }
    std::ranges::stable_sort(pairs_, {}, &CausePair::now);
    if (pairs_.size() > kMostPairs) pairs_.resize(kMostPairs);
    for (const CausePair& p : pairs_)
      for (const int j : c.terms[p.term].effect.joints)
        if (std::ranges::find(focus_, j) == focus_.end()) focus_.push_back(j);
  }

  std::optional<NextExperiment> run() {
    if (pairs_.empty()) return {};
    const std::vector<int> moving = moving_links(c_.model);
    if (!c_.model.constraints.empty())
      throw ModelError("motions that keep loops closed are not planned here (`diffnea excite`)");
    if (std::ranges::any_of(moving, [&](int i) { return c_.model.links[i].passive; }))
      throw ModelError("a joint without a motor cannot be led along a planned motion");
    const bool all = focus_.size() == moving.size();
    Rng rng(c_.seed + 1);
    for (std::size_t f = 0; f < kFamilies.size(); ++f) {
      if (kFamilies[f].one_joint && all) continue;
      for (int draw = 0; draw < kDraws; ++draw) {
        Plan plan{&kFamilies[f], {}, {}};
        plan.motion = draw_motion(kFamilies[f], rng, plan.ranges);
        if (!(fit_effort(plan.ranges, effort_, plan.motion,
                         kSamplesPerHarmonic * kFamilies[f].last) > 0.0))
          continue;
        const double rate = 1.0 / c_.plan.dt;
        ExperimentTrial trial(c_, to_trajectory(c_.model, plan.ranges, plan.motion, kPeriod, rate),
                              kFamilies[f].last / kPeriod);
        for (const CausePair& p : pairs_) plan.expected.push_back(trial.separation(p, kExperiment));
        plans_.push_back(std::move(plan));
      }
    }
    if (plans_.empty()) throw ModelError("no motion that was tried keeps the torque limits");
    return describe(choose());
  }

 private:
  struct Plan {
    const Family* family;
    std::vector<JointRange> ranges;
    FourierMotion motion;
    std::vector<double> expected = {};  ///< of the pairs
  };

  FourierMotion draw_motion(const Family& family, Rng& rng, std::vector<JointRange>& ranges) const {
    FourierOptions options;
    options.ramp = kRamp;
    options.position_share = std::min(0.95, options.position_share * family.range);
    options.velocity_share *= family.speed;
    options.velocity *= family.speed;
    options.slide_velocity *= family.speed;
    ranges = joint_ranges(c_.model, options, {});
    const long n = std::ssize(ranges);
    const int h = std::max(family.last, kOrdinaryLast);
    FourierMotion m{kPeriod, VecX<double>::Zero(n), MatX<double>::Zero(n, h),
                    MatX<double>::Zero(n, h)};
    VecX<double> a(h), b(h);
    for (long j = 0; j < n; ++j) {
      const bool other =
          family.one_joint && std::ranges::find(focus_, static_cast<int>(j)) == focus_.end();
      draw_band(other ? 1 : family.first, other ? kOrdinaryLast : family.last, rng, a, b);
      m.a.row(j) = a.transpose();
      m.b.row(j) = b.transpose();
    }
    fill_ranges(ranges, HarmonicTable(h, kSamplesPerHarmonic * h), VecX<double>::Ones(n),
                VecX<double>::Zero(n), m);
    return m;
  }

  /// The plan whose smallest separation is largest, over the pairs that some plan separates; where
  /// none separates them all, the one that separates most.
  const Plan& choose() {
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      double most = 0.0;
      for (const Plan& p : plans_) most = std::max(most, p.expected[k]);
      if (most >= kToldApart) told_.push_back(k);
    }
    const auto worth = [&](const Plan& p) {
      double smallest = 1e300;
      int told = 0;
      for (const std::size_t k : told_) {
        smallest = std::min(smallest, p.expected[k]);
        told += p.expected[k] >= kToldApart;
      }
      return std::pair{told, smallest};
    };
    const Plan* best = &plans_.front();
    for (const Plan& p : plans_)
      if (worth(p) > worth(*best)) best = &p;
    return *best;
  }

  std::string joints_in_words() const {
    const std::vector<std::string> names = joint_names(c_.model);
    std::string out;
    for (std::size_t i = 0; i < focus_.size(); ++i) out += (i ? ", " : "") + names[focus_[i]];
    return out;
  }

  NextExperiment describe(Plan plan) const {
    fit_effort(plan.ranges, effort_, plan.motion);
    NextExperiment out;
    out.motion = to_trajectory(c_.model, plan.ranges, plan.motion, kExperiment, 1.0 / c_.plan.dt);
    out.expected_delta_bic = std::numeric_limits<double>::infinity();
    std::string told, open;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      const TriedEffect& one = c_.terms[pairs_[k].term].effect;
      const TriedEffect& other = pairs_[k].rival->effect;
      const ExperimentPair pair{one.info().name, one.where,     other.info().name,
                                other.where,     pairs_[k].now, plan.expected[k]};
      out.pairs.push_back(pair);
      const std::string both =
          label(pair.effect, pair.where) + " and " + label(pair.rival, pair.rival_where);
      if (plan.expected[k] < kToldApart) {
        open += (open.empty() ? "" : "; ") + both;
        continue;
      }
      out.expected_delta_bic = std::min(out.expected_delta_bic, plan.expected[k]);
      told += (told.empty() ? "" : "; ") + std::string("between ") + both + " " +
              short_number(std::round(plan.expected[k])) + " instead of " +
              short_number(std::round(10.0 * pair.delta_bic) / 10.0);
    }
    const bool all = !plan.family->one_joint;
    out.sentence = told.empty()
                       ? ""
                       : "Move " + (all ? "every joint " : joints_in_words() + " ") +
                             plan.family->words + (all ? "" : ", the others up to 0.5 Hz") +
                             ": expected ΔBIC " + told + ".";
    if (!open.empty())
      out.sentence += (told.empty() ? "" : " ") +
                      std::string("No motion that was tried would tell apart ") + open + ".";
    if (!told.empty()) {
      out.trajectory = kNextExperimentFile;
    } else {
      out.expected_delta_bic = *std::ranges::max_element(plan.expected);
      out.motion = {};
    }
    return out;
  }

  const ExperimentContext& c_;
  EffortBound effort_;
  std::vector<CausePair> pairs_;
  std::vector<int> focus_;  ///< joints of the causes in question
  std::vector<Plan> plans_;
  std::vector<std::size_t> told_;  ///< pairs that some plan tells apart
};

}  // namespace

Recording imaginary_recording(const Trajectory& motion) {
  Recording out;
  out.source = "next experiment";
  out.joint_names = motion.joint_names;
  out.time = motion.time;
  out.q = motion.q;
  out.has_tau.assign(motion.joint_names.size(), false);
  out.tau = RowMatX<double>::Constant(motion.rows(), motion.num_joints(),
                                      std::numeric_limits<double>::quiet_NaN());
  return out;
}

std::optional<NextExperiment> next_experiment(const ExperimentContext& context) {
  return Proposal(context).run();
}

}  // namespace diffnea
