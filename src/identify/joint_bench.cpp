#include "identify/joint_bench.hpp"

#include <algorithm>
#include <functional>

#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/stepping.hpp>

#include "identify/drives.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// Tells whether an effect goes with a joint onto its bench.
bool goes_with(const BoundEffect& e, int joint, BenchGears gears) {
  if (e.links.size() > 1 || !e.follows.empty() || e.joints != std::vector<int>{joint}) return false;
  if (hides_motor(e)) return gears == BenchGears::kTaken;
  return e.info().port == Port::kJointTorque && !e.info().has(Trait::kFollowsLoad) &&
         !names_joints(e);
}

VecX<double> one(const VecX<double>& of, int joint) {
  return of.size() > 0 ? VecX<double>(of.segment(joint, 1)) : of;
}

SensorNoise one(const SensorNoise& of, int joint) {
  return {one(of.position, joint),
          one(of.step, joint),
          {of.refresh[static_cast<std::size_t>(joint)]},
          one(of.torque, joint),
          one(of.density, joint),
          one(of.period, joint)};
}

/// A link of that inertia about its joint, and the base that carries it, without weight.
Model bench(const Model& whole, int joint, double inertia) {
  Model out;
  out.name = whole.name;
  out.gravity = {0.0, 0.0, 0.0};
  out.links.resize(2);
  out.links[0].name = "bench";
  ModelLink link =
      whole.links[static_cast<std::size_t>(moving_links(whole)[static_cast<std::size_t>(joint)])];
  link.parent = 0;
  link.X_PJ = Pose<double>::identity();
  // The same about every axis, whichever the joint has.
  link.inertia = SpatialInertia<double>::from_theta(
      {inertia, 0.0, 0.0, 0.0, inertia, 0.0, 0.0, inertia, 0.0, inertia});
  out.links[1] = std::move(link);
  return out;
}

Model without_torques(Model whole) {
  std::erase_if(whole.effects, [](const EffectSpec& e) {
    return find_effect(e.effect).port != Port::kModelParameter;
  });
  return whole;
}

/// Motion in a row by the rows beside it; at rest where some position is not there.
LocalMotion differences(const MotionStretch& s, long k) {
  const long m = static_cast<long>(s.time.size()), n = s.q.cols();
  const auto known = [&](long row) { return row >= 0 && row < m && !s.q.row(row).hasNaN(); };
  LocalMotion out{VecX<double>::Zero(n), VecX<double>::Zero(n), VecX<double>::Zero(n)};
  if (!known(k)) return out;
  out.q = s.q.row(k);
  if (!known(k - 1) || !known(k + 1)) return out;
  const auto time = [&](long row) { return s.time[static_cast<std::size_t>(row)]; };
  const auto rate = [&](long from) -> VecX<double> {
    return (s.q.row(from + 1) - s.q.row(from)).transpose() / (time(from + 1) - time(from));
  };
  out.qd = 0.5 * (rate(k - 1) + rate(k));
  out.qdd = (rate(k) - rate(k - 1)) / (0.5 * (time(k + 1) - time(k - 1)));
  return out;
}

}  // namespace

/// Torque that the joint's links ask of it in every row of a stretch, and their inertia about it.
struct JointBench::Load {
  VecX<double> torque;   ///< (m) [N·m] or [N]
  VecX<double> inertia;  ///< (m) [kg·m²] or [kg]
  VecX<double> qdd;      ///< (m) of the joint [rad/s²] or [m/s²]

  /// @param moves  motion in a row: (long) -> LocalMotion
  template <class Moves>
  Load(const Tree<double>& tree, std::size_t rows, int joint, const Moves& moves)
      : torque(static_cast<long>(rows)), inertia(torque.size()), qdd(torque.size()) {
    RneaWorkspace<double, double> rnea_ws;
    MassMatrixWorkspace<double, double> mass_ws;
    for (long k = 0; k < torque.size(); ++k) {
      const LocalMotion at = moves(k);
      torque[k] = rnea<double, double>(tree, at.q, at.qd, at.qdd, rnea_ws)[joint];
      inertia[k] = mass_matrix<double, double>(tree, at.q, mass_ws)(joint, joint);
      qdd[k] = at.qdd[joint];
    }
  }
};

JointBench::JointBench(const Model& whole, const MotionData& data, const FitLayout& layout,
                       double first, int joint) {
  const Model links = without_torques(whole);
  std::vector<Load> loads;
  for (const MotionStretch& s : data.train) {
    const long m = static_cast<long>(s.time.size());
    long from = 0, end = 0;
    loads.emplace_back(extend(links, data.runs, s.run).tree, s.time.size(), joint, [&](long k) {
      const double now = s.time[static_cast<std::size_t>(k)];
      while (from < k && s.time[static_cast<std::size_t>(from)] < now - 0.5 * first) ++from;
      while (end < m && s.time[static_cast<std::size_t>(end)] <= now + 0.5 * first) ++end;
      return local_motion(s, now, from, end - from);
    });
  }
  make(whole, data, layout, loads, joint, BenchGears::kLeftOut);
}

JointBench::JointBench(const Model& whole, const MotionData& data,
                       const std::vector<MotionStretch>& moves, const FitLayout& layout, int joint,
                       BenchGears gears) {
  const Model links = without_torques(whole);
  std::vector<Load> loads;
  for (const MotionStretch& s : moves)
    loads.emplace_back(extend(links, data.runs, s.run).tree, s.time.size(), joint,
                       [&](long k) { return differences(s, k); });
  make(whole, data, layout, loads, joint, gears);
}

void JointBench::make(const Model& whole, const MotionData& data, const FitLayout& layout,
                      const std::vector<Load>& loads, int joint, BenchGears gears) {
  double inertia = 0.0, rows = 0.0;
  for (const Load& l : loads) {
    inertia += l.inertia.sum();
    rows += static_cast<double>(l.inertia.size());
  }
  inertia /= rows;
  model_ = bench(whole, joint, inertia);
  for (std::size_t k = 0; k < loads.size(); ++k) {
    const MotionStretch& s = data.train[k];
    const Load& l = loads[k];
    const long m = l.torque.size();
    MotionStretch own{s.run,
                      s.time,
                      s.q.col(joint),
                      s.u.col(joint),
                      s.u_end.col(joint),
                      true,
                      std::make_shared<const CommandPath>(s.command->of_joints(joint, 1))};
    const VecX<double> more = inertia * l.qdd - l.torque;
    own.u.col(0) += more;
    own.u_end.col(0).head(m - 1) += more.tail(m - 1);
    own.u_end(m - 1, 0) += more[m - 1];
    data_.train.push_back(std::move(own));
  }
  data_.noise = one(data.noise, joint);
  data_.runs = data.runs;
  data_.rows = data.rows;

  FitChoice nothing;
  nothing.fit.clear();
  nothing.effects.emplace();
  layout_ = make_layout(model_, nothing, data.runs);
  first_linear_ = layout_.linear.size();
  std::vector<int> now(layout.effects.size(), -1);
  for (std::size_t e = 0; e < layout.effects.size(); ++e) {
    if (!goes_with(layout.effects[e], joint, gears)) {
      whole_ = whole_ &&
               std::ranges::find(layout.effects[e].joints, joint) == layout.effects[e].joints.end();
      continue;
    }
    now[e] = static_cast<int>(effects_.size());
    effects_.push_back(e);
    BoundEffect own = layout.effects[e];
    own.joints = {0};
    own.links.assign(own.links.size(), 0);
    own.num_joints = 1;
    layout_.effects.push_back(std::move(own));
  }
  const auto take = [&](const std::vector<FitParameter>& from, std::vector<FitParameter>& to,
                        std::vector<std::size_t>& index) {
    for (std::size_t k = 0; k < from.size(); ++k) {
      if (from[k].effect < 0 || now[static_cast<std::size_t>(from[k].effect)] < 0) continue;
      to.push_back(from[k]);
      to.back().effect = now[static_cast<std::size_t>(from[k].effect)];
      index.push_back(k);
    }
  };
  take(layout.linear, layout_.linear, linear_);
  take(layout.shape, layout_.shape, shape_);
}

void JointBench::put(const MotionBeginning& own, MotionBeginning& whole) const {
  for (std::size_t e = 0; e < effects_.size(); ++e)
    whole.layout.effects[effects_[e]].parameters = own.layout.effects[e].parameters;
  const auto put_hold = [](const FitParameter& from, FitParameter& to) {
    to.fixed = from.fixed;
    to.prior = from.prior;
  };
  for (std::size_t k = 0; k < linear_.size(); ++k) {
    const std::size_t at = first_linear_ + k;
    put_hold(own.layout.linear[at], whole.layout.linear[linear_[k]]);
    whole.start[static_cast<long>(linear_[k])] = own.start[static_cast<long>(at)];
    double& scale = whole.scale[static_cast<long>(linear_[k])];
    scale = std::max(scale, own.scale[static_cast<long>(at)]);
  }
  for (std::size_t k = 0; k < shape_.size(); ++k) {
    put_hold(own.layout.shape[k], whole.layout.shape[shape_[k]]);
    whole.shape[static_cast<long>(shape_[k])] = own.shape[static_cast<long>(k)];
  }
}

bool has_benches(const Model& model, const FitLayout& layout) {
  const Tree<double> tree = make_tree(model);
  return layout.num_dofs > 1 && !tree.free_base && tree.coordinates.plain() &&
         model.constraints.empty() &&
         std::ranges::all_of(commanded_joints(layout), std::identity());
}

std::vector<JointBench> joint_benches(const Model& model, const MotionData& data,
                                      const FitLayout& layout, double first) {
  if (!has_benches(model, layout)) return {};
  VecX<double> shape(static_cast<long>(layout.shape.size()));
  for (long k = 0; k < shape.size(); ++k)
    shape[k] = layout.shape[static_cast<std::size_t>(k)].prior;
  const Model before = apply_fit(model, layout, layout.prior(), shape);
  std::vector<JointBench> out;
  for (int j = 0; j < layout.num_dofs; ++j) {
    JointBench bench(before, data, layout, first, j);
    if (count_free(bench.layout()) > 0.0) out.push_back(std::move(bench));
  }
  return out;
}

}  // namespace diffnea
