#include "excite/loop_rows.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/core/text.hpp>

#include "core/constants.hpp"

namespace diffnea {
namespace {

/// Least length at the leading joints of a motion of unit length: the others are ten times as fast
/// there, and soon a dead point follows.
constexpr double kFirm = 0.1;
constexpr double kStep =
    0.05;  ///< way of a leading joint between postures that are looked at [rad, m]
constexpr double kMargin = 0.05;  ///< share of a way that is left where the loop ends it
constexpr double kShrink =
    0.85;  ///< factor on ranges, while a corner or a random place is out of reach
constexpr int kShrinkings = 40;
constexpr int kPlaces = 64;        ///< random places that are tried in the ranges
constexpr int kMostCorners = 256;  ///< corners of the ranges that are tried
constexpr double kRetreat = 0.8;   ///< factor on a motion that does not close
/// Factor by which 20 samples a harmonic may miss the largest value (HarmonicTable::overshoot).
constexpr double kBetween = 1.0125;
constexpr double kLeastHalf = 1e-3;  ///< least half of a range that counts as one [rad, m]

const std::pair<double, double>* named(
    const std::map<std::string, std::pair<double, double>>& values, const std::string& joint) {
  const auto at = values.find(joint);
  return at == values.end() ? nullptr : &at->second;
}

double named(const std::map<std::string, double>& values, const std::string& joint,
             double otherwise) {
  const auto at = values.find(joint);
  return at == values.end() ? otherwise : at->second;
}

}  // namespace

LoopRows::LoopRows(const Model& model, const FourierOptions& options, const LimitOverrides& limits,
                   std::vector<JointRange>& ranges)
    : loop_("excite", model), joints_(joint_names(model)), ranges_(ranges) {
  range_followers(model, options, limits);
  narrow(model, limits);
}

/// The model's limits are used to the same share as those of driven joints; limits that are asked
/// for by name are used in full.
void LoopRows::range_followers(const Model& model, const FourierOptions& options,
                               const LimitOverrides& limits) {
  const std::vector<int> moving = moving_links(model);
  for (int j = 0; j < loop_.num_joints(); ++j) {
    if (loop_.leads(j)) continue;
    const auto at = static_cast<std::size_t>(j);
    const JointLimits& l = model.links[static_cast<std::size_t>(moving[at])].limits;
    JointRange r{.driven = ranges_[at].driven, .follows = true};
    r.effort = r.driven ? ranges_[at].effort : kInfinity;
    double low = l.lower, high = l.upper, share = options.position_share;
    if (const auto* p = named(limits.position, joints_[at])) {
      std::tie(low, high) = *p;
      share = 1.0;
    }
    r.half = kInfinity;
    if (std::isfinite(low) && std::isfinite(high)) {
      r.middle = 0.5 * (low + high);
      r.half = 0.5 * (high - low) * share;
    } else if (std::isfinite(low) || std::isfinite(high)) {
      constexpr double kFar = 1e6;  // [rad, m]: a bound on one side alone
      r.middle = std::isfinite(low) ? low + kFar : high - kFar;
      r.half = kFar;
    }
    r.velocity = named(limits.velocity, joints_[at],
                       is_given(l.velocity) ? l.velocity * options.velocity_share : kInfinity);
    r.acceleration = named(limits.acceleration, joints_[at], kInfinity);
    ranges_[at] = r;
  }
}

std::string LoopRows::objection(const VecX<double>& q) const {
  for (int j = 0; j < loop_.num_joints(); ++j) {
    const JointRange& r = ranges_[static_cast<std::size_t>(j)];
    if (r.follows && std::abs(q[j] - r.middle) > r.half)
      return joints_[static_cast<std::size_t>(j)] + " would be at " + short_number(q[j]) +
             ", beyond the " + short_number(r.middle - r.half) + " to " +
             short_number(r.middle + r.half) + " that it may use";
  }
  VecX<double> qd = VecX<double>::Zero(q.size()), qdd = qd;
  if (loop_.follow(q, qd, qdd) < kFirm) return "the driven joints hardly hold it (a dead point)";
  return "";
}

bool LoopRows::reach(const VecX<double>& y, VecX<double>& q, std::string* why) const {
  const VecX<double> from = loop_.positions_of_leads(q);
  const int steps =
      std::max(1, static_cast<int>(std::ceil((y - from).cwiseAbs().maxCoeff() / kStep)));
  for (int k = 1; k <= steps; ++k) {
    VecX<double> next = q;
    const VecX<double> to = from + (static_cast<double>(k) / steps) * (y - from);
    std::string found = loop_.move(to, next) ? objection(next) : "the loop does not close";
    if (!found.empty()) {
      if (why) *why = std::move(found);
      return false;
    }
    q = std::move(next);
  }
  return true;
}

void LoopRows::narrow(const Model& model, const LimitOverrides& limits) {
  const std::vector<int>& leads = loop_.leads();
  const auto d = static_cast<long>(leads.size());
  const std::vector<int> moving = moving_links(model);
  VecX<double> low(d), high(d);
  for (long i = 0; i < d; ++i) {
    const auto at = static_cast<std::size_t>(leads[static_cast<std::size_t>(i)]);
    JointRange& r = ranges_[at];
    const JointLimits& l = model.links[static_cast<std::size_t>(moving[at])].limits;
    if (!std::isfinite(l.lower) && !std::isfinite(l.upper) &&
        !limits.position.contains(joints_[at]) && !limits.position.contains(""))
      r.middle = loop_.home()[static_cast<long>(at)];
    low[i] = r.middle - r.half;
    high[i] = r.middle + r.half;
  }
  // The way in: not all of it needs to be within limits.
  VecX<double> q = loop_.home();
  const VecX<double> middle = 0.5 * (low + high);
  const VecX<double> nearest = loop_.positions_of_leads(q).cwiseMax(low).cwiseMin(high).eval();
  std::string why = "the loop does not close on the way there";
  if (!loop_.move(nearest, q) || !(why = objection(q)).empty()) {
    VecX<double> other = loop_.home();
    if (!loop_.move(middle, other) || !objection(other).empty())
      throw ModelError("excite: within the ranges of '" + model.name +
                       "' no posture is found to move about: at " + loop_.leads_text(q) + " " +
                       why + "; allow other positions (--position-limit), or state a `home`");
    q = other;
  }
  reach(middle, q);  // or not all the way

  const VecX<double> centre = loop_.positions_of_leads(q);
  VecX<double> down(d), up(d);  // ways that each may go alone
  for (long i = 0; i < d; ++i)
    for (const bool upward : {false, true}) {
      VecX<double> y = centre, at = q;
      y[i] = upward ? high[i] : low[i];
      const double whole = std::abs(y[i] - centre[i]);
      const bool all = reach(y, at);
      const double way = std::abs(loop_.positions_of_leads(at)[i] - centre[i]);
      (upward ? up : down)[i] = all ? whole : (1.0 - kMargin) * way;
    }
  Rng rng(1);
  const auto in_reach = [&](const VecX<double>& share) {  // −1 … 1 of every way
    const VecX<double> y =
        centre + (share.array() > 0.0).select(share.cwiseProduct(up), share.cwiseProduct(down));
    VecX<double> at = q;
    return reach(y, at);
  };
  const auto all_in_reach = [&] {
    const int corners = d < 9 ? 1 << d : kMostCorners;
    VecX<double> share(d);
    for (int c = 0; c < corners; ++c) {
      for (long i = 0; i < d; ++i)
        share[i] = (d < 9 ? (c >> i & 1) != 0 : rng.uniform(0.0, 1.0) > 0.5) ? 1.0 : -1.0;
      if (!in_reach(share)) return false;
    }
    for (int k = 0; k < kPlaces; ++k) {
      for (double& x : share) x = rng.uniform(-1.0, 1.0);
      if (!in_reach(share)) return false;
    }
    return true;
  };
  for (int k = 0; d > 1 && k < kShrinkings && !all_in_reach(); ++k) {
    up *= kShrink;
    down *= kShrink;
  }
  VecX<double> y = centre;
  bool moves = false;
  for (long i = 0; i < d; ++i) {
    const auto at = static_cast<std::size_t>(leads[static_cast<std::size_t>(i)]);
    JointRange& r = ranges_[at];
    if (!r.moves()) continue;
    const double a = centre[i] - down[i], b = centre[i] + up[i];
    if (a > low[i] + 1e-9 || b < high[i] - 1e-9)
      notes_.push_back(joints_[at] + ": from " + short_number(low[i]) + " to " +
                       short_number(high[i]) +
                       " its loop does not close or is not held all "
                       "along, or what follows has limits: it moves within " +
                       short_number(a) + " to " + short_number(b));
    r.middle = y[i] = 0.5 * (a + b);
    r.half = 0.5 * (b - a);
    if (r.half < kLeastHalf) r.half = 0.0;
    moves |= r.moves();
  }
  base_ = q;
  if (!moves || !reach(y, base_))
    throw ModelError("excite: '" + model.name + "' hardly moves about " + loop_.leads_text(q) +
                     ": the loop does not close there, is not held, or what follows meets its "
                     "limits; allow other positions (--position-limit), or state a `home`");
}

VecX<double> LoopRows::posture_at(const VecX<double>& q) const {
  VecX<double> out = base_;
  if (!loop_.move(loop_.positions_of_leads(q), out)) return {};
  return out;
}

bool LoopRows::complete(VecX<double>& q, VecX<double>& qd, VecX<double>& qdd) const {
  const VecX<double> posture = posture_at(q);
  if (posture.size() == 0 || !(loop_.follow(posture, qd, qdd) >= kFirm)) return false;
  q = posture;
  return true;
}

double LoopRows::complete(MotionRows& rows, const VecX<double>& centre) const {
  const VecX<double> at_rest = posture_at(centre);
  if (at_rest.size() == 0 || !objection(at_rest).empty()) return 0.0;
  VecX<double> posture = at_rest;
  if (!loop_.move(loop_.positions_of_leads(rows.q.row(0).transpose()), posture)) return kRetreat;
  if (loop_.follow(rows.q, rows.qd, rows.qdd, posture, kFirm) < rows.q.rows()) return kRetreat;
  double gain = 1.0;
  for (int j = 0; j < loop_.num_joints(); ++j) {
    const JointRange& r = ranges_[static_cast<std::size_t>(j)];
    if (!r.follows) continue;
    if (std::isfinite(r.half)) {
      const double up = kBetween * (rows.q.col(j).maxCoeff() - at_rest[j]),
                   down = kBetween * (at_rest[j] - rows.q.col(j).minCoeff());
      if (up > 0.0) gain = std::min(gain, (r.middle + r.half - at_rest[j]) / up);
      if (down > 0.0) gain = std::min(gain, (at_rest[j] - r.middle + r.half) / down);
    }
    const double speed = kBetween * rows.qd.col(j).cwiseAbs().maxCoeff(),
                 change = kBetween * rows.qdd.col(j).cwiseAbs().maxCoeff();
    if (speed > r.velocity) gain = std::min(gain, r.velocity / speed);
    if (change > r.acceleration) gain = std::min(gain, r.acceleration / change);
  }
  return gain < 1.0 ? 0.99 * gain : 1.0;
}

}  // namespace diffnea
