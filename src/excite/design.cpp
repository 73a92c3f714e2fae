#include <algorithm>
#include <cmath>
#include <memory>

#include <diffnea/core/error.hpp>
#include <diffnea/excite/design.hpp>

#include "excite/cma_es.hpp"
#include "excite/information.hpp"

namespace diffnea {
namespace {

constexpr int kSamplesPerHarmonic = 20;  ///< of a trial: its limits are kept to 1.2 %
constexpr double kStep = 0.25;           ///< first step of the search, of coefficients of size one
constexpr double kOffMiddle = 0.5;    ///< random places of motions that the middle does not allow
constexpr double kNoiseShare = 0.01;  ///< of an effort limit
constexpr double kIllConditioned = 1e4;  ///< standard errors that differ by as much
/// A trial that needs too much torque ranks behind all that do not, by how much.
constexpr double kInfeasible = 1e6;
constexpr int kLoopSteps = 16;        ///< in which a motion is shrunk until its loops close
constexpr double kOutOfReach = 10.0;  ///< rank of a motion whose centre does not close

void require(bool ok, const std::string& what) {
  if (!ok) throw Error("excite: " + what);
}

void check(const DesignOptions& o) {
  const FourierOptions& m = o.motion;
  require(m.harmonics >= 3, "got " + std::to_string(m.harmonics) +
                                " harmonics, expected 3 or more (two go into starting at rest)");
  require(m.period > 0 && m.duration > 0 && m.rate > 0,
          "period, duration and rate must be positive");
  require(m.rate * m.duration < 1e8, "more than 1e8 rows; lower the rate or the duration");
  require(m.rate * m.period > 4.0 * m.harmonics,
          "the rate is too low for the highest harmonic; raise it above " +
              short_number(4.0 * m.harmonics / m.period) + " Hz");
  require(o.starts >= 1 && o.iterations >= 0, "starts must be 1 or more, iterations 0 or more");
}

class Design {
 public:
  Design(const Model& model, const DesignOptions& options)
      : model_(model),
        options_(options),
        harmonics_(options.motion.harmonics),
        ranges_(joint_ranges(model, options.motion, options.limits)),
        loops_(model.constraints.empty()
                   ? nullptr
                   : std::make_unique<LoopRows>(model, options.motion, options.limits, ranges_)),
        table_(harmonics_, kSamplesPerHarmonic * harmonics_),
        rest_(harmonics_),
        rng_(options.motion.seed),
        information_(model, ranges_, rng_, loops_.get()),
        effort_(model, loops_.get()) {
    period_ = static_cast<double>(std::lround(options.motion.period * options.motion.rate)) /
              options.motion.rate;
    for (std::size_t j = 0; j < ranges_.size(); ++j)
      if (ranges_[j].moves()) moving_.push_back(static_cast<long>(j));
    per_joint_ = 2 * (harmonics_ - 1) + 2;
  }

  Excitation run() {
    set_noise();
    const std::vector<VecX<double>> starts = draw_starts();
    std::vector<std::pair<double, std::size_t>> random;  // of the motions about the middle
    std::size_t best = 0;
    double best_cost = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < starts.size(); ++i) {
      const double c = cost(starts[i]);
      if (c < kInfeasible && i < static_cast<std::size_t>(options_.starts))
        random.push_back({c, i});
      if (c < best_cost) best = i, best_cost = c;
    }
    CmaOptions search;
    search.step = kStep;
    search.generations = options_.iterations;
    const CmaResult found = minimise_by_samples(
        [this](const VecX<double>& x) { return cost(x); }, starts[best], search, rng_,
        [this](int generation, double value) {
          return !options_.progress || options_.progress({"designing", generation, 0, value});
        });
    FourierMotion motion = motion_of(found.x);
    const bool feasible = found.value < kInfeasible && scale_to_effort(motion);
    if (!feasible || !(fit_effort(ranges_, effort_, motion) > 0.0)) refuse();
    Excitation out;
    out.iterations = found.generations;
    out.interrupted = found.interrupted;
    const FourierMotion* reference = &motion;
    FourierMotion median;
    if (!random.empty()) {
      std::ranges::sort(random);
      median = motion_of(starts[random[random.size() / 2].second]);
      scale_to_effort(median);
      if (fit_effort(ranges_, effort_, median) > 0.0) reference = &median;
    }
    describe(motion, *reference, out);
    return out;
  }

 private:
  /// x holds, for every joint that moves, H − 1 numbers each for a and b, then amplitude and place.
  FourierMotion motion_of(const VecX<double>& x) const {
    const long n = static_cast<long>(ranges_.size()), free = harmonics_ - 1;
    FourierMotion motion{period_, VecX<double>::Zero(n), MatX<double>::Zero(n, harmonics_),
                         MatX<double>::Zero(n, harmonics_)};
    VecX<double> share = VecX<double>::Zero(n), place = share;
    for (std::size_t k = 0; k < moving_.size(); ++k) {
      const auto own = x.segment(static_cast<long>(k) * per_joint_, per_joint_);
      const long j = moving_[k];
      motion.a.row(j) = (rest_.a * own.head(free)).transpose();
      motion.b.row(j) = (rest_.b * own.segment(free, free)).transpose();
      share[j] = std::exp(-own[2 * free] * own[2 * free]);
      place[j] = std::tanh(own[2 * free + 1]);
    }
    fill_ranges(ranges_, table_, share, place, motion);
    return motion;
  }

  /// Random shapes at full size about the middle; then as many elsewhere, for arms that the middle
  /// is too heavy for.
  std::vector<VecX<double>> draw_starts() {
    std::vector<VecX<double>> out;
    const long free = harmonics_ - 1;
    VecX<double> a(harmonics_), b(harmonics_);
    for (int i = 0; i < 2 * options_.starts; ++i) {
      VecX<double> x = VecX<double>::Zero(per_joint_ * static_cast<long>(moving_.size()));
      for (std::size_t k = 0; k < moving_.size(); ++k) {
        auto own = x.segment(static_cast<long>(k) * per_joint_, per_joint_);
        draw_series(rest_, rng_, a, b);
        own.head(free) = rest_.a.transpose() * a;
        own.segment(free, free) = rest_.b.transpose() * b;
        own.head(2 * free).normalize();  // the size follows from the limits
        if (i < options_.starts) continue;
        own[2 * free] = kOffMiddle * rng_.normal();
        own[2 * free + 1] = kOffMiddle * rng_.normal();
      }
      out.push_back(std::move(x));
    }
    return out;
  }

  /// Shrinks a motion about its centre until the samples' torques meet the limits: they are nearly
  /// straight lines over the size, so that two or three steps do.
  bool scale_to_effort(FourierMotion& motion, double* excess = nullptr,
                       Information::Rows* rows = nullptr) {
    VecX<double> holding;
    for (int step = 0; step < (loops_ ? kLoopSteps : 4); ++step) {
      MotionRows sampled = table_.sample(motion);
      if (const double size = loops_ ? loops_->complete(sampled, motion.centre) : 1.0; size < 1.0) {
        if (excess) *excess = size > 0.0 ? 1.0 / size : kOutOfReach;
        if (size == 0.0) return false;
        motion.a *= size;
        motion.b *= size;
        continue;
      }
      Information::Rows now = information_.rows(sampled);
      double worst = 0.0;
      for (std::size_t j = 0; j < ranges_.size(); ++j)
        worst = std::max(
            worst, now.torque.col(static_cast<long>(j)).cwiseAbs().maxCoeff() / ranges_[j].effort);
      if (excess) *excess = worst;
      if (worst <= 1.0) {
        if (rows) *rows = std::move(now);
        return true;
      }
      if (holding.size() == 0) holding = effort_.holding(motion.centre);
      double gain = 1.0;
      for (std::size_t k = 0; k < ranges_.size(); ++k) {
        const long j = static_cast<long>(k);
        const double limit = ranges_[k].effort;
        if (!std::isfinite(limit)) continue;
        if (std::abs(holding[j]) >= limit) {
          if (excess) *excess = 10.0 * std::abs(holding[j]) / limit;
          return false;
        }
        for (long i = 0; i < now.torque.rows(); ++i) {
          const double more = now.torque(i, j) - holding[j];
          if (std::abs(now.torque(i, j)) > limit)
            gain = std::min(gain, (limit - std::copysign(1.0, more) * holding[j]) / std::abs(more));
        }
      }
      motion.a *= 0.99 * gain;
      motion.b *= 0.99 * gain;
    }
    return false;
  }

  double cost(const VecX<double>& x) {
    FourierMotion motion = motion_of(x);
    Information::Rows rows;
    double excess = 0.0;
    if (!scale_to_effort(motion, &excess, &rows)) return kInfeasible * (1.0 + excess);
    const double value = -log_det(rows.columns);
    return std::isfinite(value) ? value : kInfeasible * 0.99;
  }

  void set_noise() {
    const long n = static_cast<long>(ranges_.size());
    VecX<double> noise(information_.num_rows());
    require(options_.noise.empty() || static_cast<long>(options_.noise.size()) == n,
            "got the noise of " + std::to_string(options_.noise.size()) + " joints, expected " +
                std::to_string(n));
    FourierMotion motion = motion_of(draw_starts().front());
    const VecX<double> largest =
        information_.rows(closed(motion)).torque.cwiseAbs().colwise().maxCoeff().transpose();
    double shares = 0.0;  // squares of what the noise is of the joints' torques
    for (long j = 0; j < n; ++j) {
      const double effort = ranges_[static_cast<std::size_t>(j)].effort;
      noise[j] = !options_.noise.empty() ? options_.noise[static_cast<std::size_t>(j)]
                 : std::isfinite(effort) ? kNoiseShare * effort
                                         : kNoiseShare * largest[j];
      if (!(noise[j] > 0.0)) noise[j] = 1.0;
      if (largest[j] > 0.0) shares += std::pow(noise[j] / largest[j], 2) / static_cast<double>(n);
    }
    for (long j = n; j < noise.size(); ++j) {
      noise[j] = std::sqrt(shares) * largest[j];
      if (!(noise[j] > 0.0)) noise[j] = 1.0;
    }
    information_.set_noise(noise);
  }

  /// Samples of a motion, which shrinks until its loops close; at rest in the end.
  MotionRows closed(FourierMotion& motion) const {
    for (int step = 0;; ++step) {
      MotionRows rows = table_.sample(motion);
      const double size = loops_ ? loops_->complete(rows, motion.centre) : 1.0;
      if (size == 1.0) return rows;
      if (step > kLoopSteps) refuse();
      const double gain = step < kLoopSteps ? size : 0.0;
      motion.a *= gain;
      motion.b *= gain;
      for (std::size_t j = 0; j < ranges_.size() && gain == 0.0; ++j)
        motion.centre[static_cast<long>(j)] = ranges_[j].middle;
    }
  }

  [[noreturn]] void refuse() const {
    VecX<double> centre(static_cast<long>(ranges_.size()));
    for (long j = 0; j < centre.size(); ++j)
      centre[j] = ranges_[static_cast<std::size_t>(j)].middle;
    const VecX<double> holding = effort_.holding(centre);
    const std::vector<std::string> names = joint_names(model_);
    if (loops_ &&
        std::ranges::none_of(ranges_, [](const JointRange& r) { return std::isfinite(r.effort); }))
      throw ModelError("excite: " + model_.name +
                       ": no motion that was tried keeps its loops closed, and what follows within "
                       "its limits; allow other positions (--position-limit), or correct the "
                       "limits");
    std::size_t worst = 0;
    const auto share = [&](std::size_t j) {
      return std::abs(holding[static_cast<long>(j)]) / ranges_[j].effort;
    };
    for (std::size_t j = 0; j < ranges_.size(); ++j)
      if (share(j) > share(worst)) worst = j;
    const std::string found = "joint '" + names[worst] + "' may use " +
                              short_number(ranges_[worst].effort) +
                              " of torque, and holding the middle of the ranges takes " +
                              short_number(std::abs(holding[static_cast<long>(worst)]));
    throw ModelError(
        "excite: " + model_.name + ": " +
        (share(worst) >= 1.0 ? "no posture that was tried can be held: "
                             : "no motion that was tried stays within the torque limits: ") +
        found +
        "; raise the torque limit (--torque-limit), allow other positions (--position-limit), "
        "slow the motion down, or correct the model");
  }

  LimitUse use_of(std::size_t j, const MotionRows& rows, double o,
                  const VecX<double>& torque) const {
    const long c = static_cast<long>(j);
    const JointRange& r = ranges_[j];
    LimitUse out;
    if (r.moves() || r.follows) {
      out.position = (rows.q.col(c).array() - r.middle).abs().maxCoeff() * o / r.half;
      out.velocity = rows.qd.col(c).cwiseAbs().maxCoeff() * o / r.velocity;
      out.acceleration = rows.qdd.col(c).cwiseAbs().maxCoeff() * o / r.acceleration;
    }
    if (std::isfinite(r.effort)) out.effort = torque[c] / r.effort;
    out.joint = joint_names(model_)[j];
    return out;
  }

  void describe(const FourierMotion& motion, const FourierMotion& random, Excitation& out) {
    const FourierOptions& m = options_.motion;
    out.trajectory = to_trajectory(model_, ranges_, motion, m.duration, m.rate, loops_.get());
    out.period = motion.period;
    out.base_parameters = information_.num_parameters();
    FourierMotion this_one = motion, median = random;  // both are closed already
    const RowMatX<double> now = information_.rows(closed(this_one)).columns,
                          before = information_.rows(closed(median)).columns;
    out.log_det = log_det(now);
    out.random_log_det = log_det(before);
    out.condition = condition_number(now);
    out.random_condition = condition_number(before);
    const VecX<double> ratio = standard_errors(now).cwiseQuotient(standard_errors(before));
    out.std_ratio =
        std::exp((out.random_log_det - out.log_det) / (2.0 * information_.num_parameters()));
    out.best_std_ratio = ratio.minCoeff();
    out.worst_std_ratio = ratio.maxCoeff();
    const HarmonicTable fine(harmonics_, 10 * table_.count());
    MotionRows rows = fine.sample(motion);
    if (loops_) loops_->complete(rows, motion.centre);
    const VecX<double> torque = effort_.largest(motion);
    for (std::size_t j = 0; j < ranges_.size(); ++j)
      if (ranges_[j].driven) out.limits.push_back(use_of(j, rows, fine.overshoot(), torque));
    if (out.condition > kIllConditioned)
      out.notes.push_back("the condition number is " + short_number(out.condition) +
                          ": within these limits some parameters hardly show; allow more torque, "
                          "speed or range");
    if (loops_) out.notes.insert(out.notes.end(), loops_->notes().begin(), loops_->notes().end());
    if (model_.free_base)
      out.notes.push_back("in flight: the base '" + model_.links[0].name +
                          "' gives way to the joints and no weight acts; torque limits hold with "
                          "the base held, too");
    add_notes(out.notes);
    if (std::abs(motion.period - m.period) > 1e-9 * m.period)
      out.notes.push_back("the period is " + short_number(motion.period) +
                          " s, a whole number of rows");
  }

  void add_notes(std::vector<std::string>& notes) const {
    const FourierOptions& m = options_.motion;
    const LimitOverrides& limits = options_.limits;
    const auto given = [](const auto& values, const std::string& joint) {
      return values.contains(joint) || values.contains("");
    };
    std::size_t j = 0;
    double ramp_joints = 0;
    for (const int i : moving_links(model_)) {
      const ModelLink& link = model_.links[static_cast<std::size_t>(i)];
      const JointRange& r = ranges_[j++];
      if (!r.driven) continue;
      const std::string unit = link.type == ModelJoint::kRevolute ? " rad" : " m";
      const JointLimits& l = link.limits;
      if (r.follows)
        notes.push_back(link.joint + ": follows in its loop, and is commanded what it does there");
      else if (!(r.half > 0.0))
        notes.push_back(link.joint + ": its limits leave no range, it is held at " +
                        short_number(r.middle) + unit);
      else if (!std::isfinite(l.lower) && !std::isfinite(l.upper) &&
               !given(limits.position, link.joint))
        notes.push_back(link.joint + ": no position limits, it moves within " +
                        short_number(r.middle - r.half) + " to " + short_number(r.middle + r.half) +
                        unit);
      const double over = std::max(l.lower - (r.middle - r.half), r.middle + r.half - l.upper);
      if (!r.follows && given(limits.position, link.joint) && over > 1e-9)
        notes.push_back("WARNING: " + link.joint + " is to move within " +
                        short_number(r.middle - r.half) + " to " + short_number(r.middle + r.half) +
                        unit + " as was asked, beyond the model's limits " + short_number(l.lower) +
                        " to " + short_number(l.upper));
      if (!r.follows && !is_given(l.velocity) && !given(limits.velocity, link.joint))
        notes.push_back(link.joint + ": no velocity limit" + (l.velocity == 0.0 ? " (0)" : "") +
                        ", it moves at up to " + short_number(r.velocity) + unit + "/s");
      if (!is_given(l.effort) && !given(limits.effort, link.joint))
        notes.push_back(link.joint + ": no effort limit" + (l.effort == 0.0 ? " (0)" : "") +
                        ", its torque is not looked at");
      ramp_joints += !given(limits.acceleration, link.joint);
    }
    if (ramp_joints > 0)
      notes.push_back(
          "models state no acceleration limits: from rest to the velocity that is used "
          "in " +
          short_number(m.ramp) + " s; --acceleration-limit sets them");
    notes.push_back("of the model's limits " + short_number(100.0 * m.position_share) +
                    " % of the range, " + short_number(100.0 * m.velocity_share) +
                    " % of the velocity and " + short_number(100.0 * m.effort_share) +
                    " % of the torque are used; collisions are not looked at");
  }

  const Model& model_;
  const DesignOptions& options_;
  int harmonics_;
  std::vector<JointRange> ranges_;
  std::unique_ptr<LoopRows> loops_;  ///< null: a tree
  HarmonicTable table_;
  RestBasis rest_;
  Rng rng_;
  Information information_;
  EffortBound effort_;
  double period_ = 0.0;
  std::vector<long> moving_;
  long per_joint_ = 0;
};

}  // namespace

Excitation design_excitation(const Model& model, const DesignOptions& options) {
  if (model.free_base) require_no_constraints("excite of flights", model);
  check(options);
  return Design(model, options).run();
}

}  // namespace diffnea
