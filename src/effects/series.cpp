#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/effects/hidden_motor.hpp>
#include <diffnea/effects/series.hpp>

#include "effects/loop_torques.hpp"
#include "effects/swing.hpp"

namespace diffnea {
namespace {

using Rows = RowMatX<double>;

/// Torque that rotors need at every row.
Rows rotor_torque(const Tree<double>& tree, const JointSeries& x) {
  Rows out(x.rows(), tree.num_dofs());
  for (int j = 0; j < tree.num_dofs(); ++j) out.col(j) = tree.armature(j) * x.qdd.col(j);
  return out;
}

/// Torques along a motion as they act: where loops are closed, those of the leading joints.
class AtDrives {
 public:
  AtDrives(const ExtendedTree& base, const JointSeries& x) : loops_(base.loops.get()) {
    if (loops_) maps_ = loops_->maps(base.tree, x.q);
  }
  Rows operator()(Rows torque) const {
    if (!loops_) return torque;
    return loops_->at_leads(maps_, torque);
  }

 private:
  const LoopTorques* loops_;
  std::vector<MatX<double>> maps_;
};

/// Torque that the links transmit at every row, without rotor inertia.
Rows link_torque(const ExtendedTree& base, const JointSeries& x, const AtDrives& at_drives) {
  return at_drives(rnea_batch(base.tree, x.q, x.qd, x.qdd) - rotor_torque(base.tree, x));
}
Rows link_torque(const ExtendedTree& base, const JointSeries& x) {
  return link_torque(base, x, {base, x});
}

JointSample<double> sample(const JointSeries& x, long k) {
  return {x.start + static_cast<double>(k) * x.dt,
          x.run,
          x.q.row(k).data(),
          x.qd.row(k).data(),
          x.qdd.row(k).data(),
          x.tau.row(k).data()};
}

void add_local(const BoundEffect& effect, const Tree<double>& tree, const JointSeries& x,
               const double* p, Rows& out) {
  visit_formula(effect, [&](const auto& formula) {
    for (long k = 0; k < x.rows(); ++k)
      detail::add_torque(formula, effect, &tree, sample(x, k), p, out.row(k).data());
  });
}

/// The same with one joint moving as told, the others as in the series.
struct Moved {
  int joint;
  const VecX<double>&q, &qd, &qdd;
};
void add_local(const BoundEffect& effect, const Tree<double>& tree, const JointSeries& x,
               const Moved& moved, const double* p, Rows& out) {
  VecX<double> q(x.q.cols()), qd = q, qdd = q;
  visit_formula(effect, [&](const auto& formula) {
    for (long k = 0; k < x.rows(); ++k) {
      q = x.q.row(k).transpose();
      qd = x.qd.row(k).transpose();
      qdd = x.qdd.row(k).transpose();
      q[moved.joint] = moved.q[k];
      qd[moved.joint] = moved.qd[k];
      qdd[moved.joint] = moved.qdd[k];
      JointSample<double> at = sample(x, k);
      at.q = q.data();
      at.qd = qd.data();
      at.qdd = qdd.data();
      detail::add_torque(formula, effect, &tree, at, p, out.row(k).data());
    }
  });
}

/// The sign equation with all effects of one instant, at x.tau.
Rows local_total(const ExtendedTree& base, const JointSeries& x, const AtDrives& at_drives) {
  Rows out = x.tau + rotor_torque(base.tree, x);
  for (const BoundEffect& e : base.effects) add_local(e, base.tree, x, e.parameters.data(), out);
  return at_drives(std::move(out));
}

/// Motion as it was, for an effect of a channel.
JointSeries true_motion(const BoundEffect& effect, const JointSeries& x, const double* p) {
  JointSeries truth = x;
  visit_formula(effect, [&](const auto& formula) {
    if constexpr (requires { formula.add_to_motion(x, 0, p, truth); })
      for (const int j : effect.joints) formula.add_to_motion(x, j, p, truth);
  });
  return truth;
}

bool acts_on(const BoundEffect& effect, int joint) {
  return std::ranges::find(effect.joints, joint) != effect.joints.end();
}

/// Torque on the link's side of a spring at `joint`: what the links transmit, what pulls at them,
/// and the friction that does not turn with the motor.
VecX<double> load_on_spring(const ExtendedTree& base, const JointSeries& x, int joint,
                            double friction_share) {
  VecX<double> out = x.tau.col(joint);
  for (const BoundEffect& e : base.effects) {
    const double share = 1.0 - motor_share(e.info(), friction_share);
    // A force on a link is felt by every joint before it, too.
    if (share == 0.0 || !(acts_on(e, joint) || e.info().port == Port::kLinkForce)) continue;
    Rows torque = Rows::Zero(x.rows(), x.q.cols());
    add_local(e, base.tree, x, e.parameters.data(), torque);
    out += share * torque.col(joint);
  }
  return out;
}

/// What friction on the motor's side changes because it turns at θ̇, not q̇.
Rows moved_friction(const ExtendedTree& base, const JointSeries& x, int joint,
                    const VecX<double>& deflection, double friction_share) {
  const VecX<double> speed = derivative(deflection, x.dt);
  const VecX<double> q = x.q.col(joint) + deflection, qd = x.qd.col(joint) + speed,
                     qdd = x.qdd.col(joint) + derivative(speed, x.dt);
  Rows out = Rows::Zero(x.rows(), x.q.cols());
  for (const BoundEffect& e : base.effects) {
    const double share = motor_share(e.info(), friction_share);
    if (share == 0.0 || !e.info().motor_side || !acts_on(e, joint)) continue;
    Rows there = Rows::Zero(x.rows(), x.q.cols()), here = there;
    add_local(e, base.tree, x, {joint, q, qd, qdd}, e.parameters.data(), there);
    add_local(e, base.tree, x, e.parameters.data(), here);
    out += share * (there - here);
  }
  return out;
}

/// Inertia of the links at every row, as `joint` alone feels it.
VecX<double> link_inertia(const Tree<double>& tree, const JointSeries& x, int joint) {
  Tree<double> floating = tree;  // nothing but an acceleration of 1
  floating.gravity = {0.0, 0.0, 0.0};
  const Rows still = Rows::Zero(x.rows(), x.q.cols());
  Rows one = still;
  one.col(joint).setOnes();
  return rnea_batch(floating, x.q, still, one).col(joint).array() - tree.armature(joint);
}

/// The same of the base model, as the series has it.
VecX<double> inertia_behind(const ExtendedTree& base, const JointSeries& x, int joint) {
  return x.inertia.size() > 0 ? VecX<double>(x.inertia.col(joint))
                              : link_inertia(base.tree, x, joint);
}

/// Motion of the links where the log has the motor's at `joint`; the motor's where the base, which
/// a linear fit may have left, gives the links an inertia below zero and nothing swings. The second
/// round takes what hangs on the link where it is, not where its motor is.
JointSeries behind_encoder(const MotorSpring<double>& spring, const ExtendedTree& base,
                           const JointSeries& x, int joint) {
  constexpr int kRounds = 2;
  const VecX<double> inertia = inertia_behind(base, x, joint);
  JointSeries links = x;
  if (!(inertia.minCoeff() > 0.0)) return links;
  VecX<double> of_spring =
      VecX<double>::Constant(x.rows(), std::numeric_limits<double>::quiet_NaN());
  if (x.logged.size() > 0)  // the motor's side takes all but what the links transmit
    of_spring = x.logged.col(joint) - x.drive().col(joint) +
                load_on_spring(base, x, joint, spring.friction_share);
  for (int round = 0; round < kRounds; ++round) {
    const VecX<double> ahead = (x.qdd - links.qdd).col(joint);
    const VecX<double> load = load_on_spring(base, links, joint, spring.friction_share),
                       push = load + inertia.cwiseProduct(ahead);
    const Swing start = of_spring.allFinite()
                            ? started(push, of_spring, inertia, x.dt, spring)
                            : led(push, inertia, x.dt, spring);
    const VecX<double> wound = swung(push, inertia, x.dt, spring, start);
    const VecX<double> speed = derivative(wound, x.dt);
    links.q.col(joint) = x.q.col(joint) - wound;
    links.qd.col(joint) = x.qd.col(joint) - speed;
    links.qdd.col(joint) = x.qdd.col(joint) - derivative(speed, x.dt);
    links.tau = link_torque(base, links);
  }
  return links;
}

/// Motion of the links where the log has the motor's at `joint`, between flanks. A motor that flies
/// beside a link that flies: what the log has for the load, over J, and what the links would ask
/// for, over M. The logged acceleration, which a filter has spread over an impact, is in neither
/// sum.
/// @throws DataError without x.logged
JointSeries behind_encoder(const Backlash& gap, const double* p, const ExtendedTree& base,
                           const JointSeries& x, int joint) {
  const VecX<double> M = inertia_behind(base, x, joint);
  const MotorSpring<double> spring = gap.motor_spring(p);
  const double J = spring.inertia;
  JointSeries links = x;
  if (!(J > 0.0 && M.minCoeff() > 0.0)) return links;
  if (x.logged.rows() != x.rows())
    throw DataError("backlash: got no logged torque, by which the rotor flies; set x.logged");
  const VecX<double> asked = load_on_spring(base, x, joint, spring.friction_share),
                     given = (x.logged - x.drive()).col(joint) + asked;
  const VecX<double> push = ((M.array() * given.array() + J * asked.array()) / (J + M.array())),
                     reduced = J * M.array() / (J + M.array());
  const Backlash::Flight flight =
      gap.flight(push, reduced, (asked - given).cwiseQuotient(M), x.dt, p);
  links.q.col(joint) -= flight.at;
  links.qd.col(joint) -= flight.speed;
  links.qdd.col(joint) -= flight.acceleration;
  links.tau = link_torque(base, links);
  return links;
}

/// Torque in addition at all joints because the links do not move as the log has it; the joint's
/// armature does.
Rows moved_links(const MotorSpring<double>& spring, const ExtendedTree& base, const JointSeries& x,
                 const JointSeries& links, int joint) {
  Rows out = links.tau - x.tau;
  for (const BoundEffect& e : base.effects) {
    const double at_motor = acts_on(e, joint) ? motor_share(e.info(), spring.friction_share) : 0.0;
    if (at_motor == 1.0) continue;
    Rows there = Rows::Zero(x.rows(), x.q.cols()), here = there;
    add_local(e, base.tree, links, e.parameters.data(), there);
    add_local(e, base.tree, x, e.parameters.data(), here);
    out += (1.0 - at_motor) * (there - here);
  }
  return out;
}

/// Torque of a state along the motion, the velocity straight between the rows.
template <JointStateEffect E>
VecX<double> state_series(const JointSeries& x, int joint, const double* p) {
  constexpr int kSubsteps = 8;  // the velocity is constant within one
  const double h = x.dt / kSubsteps;
  VecX<double> out(x.rows());
  double z = 0.0;
  for (long k = 0; k < x.rows(); ++k) {
    for (int i = 0; k > 0 && i < kSubsteps; ++i) {
      const double share = (i + 0.5) / kSubsteps;
      const double v = (1 - share) * x.qd(k - 1, joint) + share * x.qd(k, joint);
      z = advanced_over<E>(z, {v * h, v, h}, p);
    }
    out[k] = state_torque<E>(z, x.qd(k, joint), p);
  }
  return out;
}

Rows memory_torque(const BoundEffect& effect, const ExtendedTree& base, const JointSeries& x,
                   const double* p) {
  Rows out = Rows::Zero(x.rows(), x.q.cols());
  visit_formula(effect, [&]<class E>(const E& formula) {
    for (const int j : effect.joints) {
      if constexpr (requires { formula.encoder_at_motor(p); })
        if (formula.encoder_at_motor(p)) {
          const MotorSpring<double> spring = formula.motor_spring(p);
          if constexpr (requires { typename E::Flight; })
            out += moved_links(spring, base, x, behind_encoder(formula, p, base, x, j), j);
          else
            out += moved_links(spring, base, x, behind_encoder(spring, base, x, j), j);
          continue;
        }
      if constexpr (requires { formula.torque_series(x, j, p); })
        out.col(j) += formula.torque_series(x, j, p);
      else if constexpr (JointStateEffect<E>)
        out.col(j) += state_series<E>(x, j, p);
      if constexpr (requires { formula.rotor_torque(VecX<double>(), x.dt, p); }) {
        const double share = formula.motor_spring(p).friction_share;
        const VecX<double> wound = formula.deflection(load_on_spring(base, x, j, share), x.dt, p);
        out.col(j) += formula.rotor_torque(wound, x.dt, p);
        if (!base.effects.empty()) out += moved_friction(base, x, j, wound, share);
      }
    }
  });
  return out;
}

/// @throws ShapeError
void require_shapes(const BoundEffect& effect, const ExtendedTree& base, const JointSeries& x) {
  const int n = base.tree.num_dofs();
  require_size("series: joints of the effect's model", effect.num_joints, n, "joint");
  for (const Rows* m : {&x.q, &x.qd, &x.qdd}) {
    require_size("series: columns of the motion", m->cols(), n, "joint");
    require_size("series: rows of the motion", m->rows(), x.rows(), "row of q");
  }
  if (!(x.dt > 0.0))
    throw ShapeError("series: dt = " + std::to_string(x.dt) + " s, expected above 0");
  for (const Rows* m : {&x.tau, &x.total, &x.logged, &x.inertia}) {
    if (m->size() == 0) continue;
    require_size("series: columns of the torque", m->cols(), n, "joint");
    require_size("series: rows of the torque", m->rows(), x.rows(), "row of q");
  }
}

/// A series with its predicted torques, which it borrows where they are there.
class Complete {
 public:
  Complete(const BoundEffect& effect, const ExtendedTree& base, const JointSeries& x) : x_(&x) {
    require_shapes(effect, base, x);
    if (x.tau.size() > 0) return;
    own_ = x;
    own_.tau = link_torque(base, x);
    x_ = &own_;
  }
  Complete(const Complete&) = delete;
  Complete& operator=(const Complete&) = delete;
  const JointSeries& operator*() const { return *x_; }

 private:
  JointSeries own_;
  const JointSeries* x_;
};

Rows torque_of(const BoundEffect& effect, const ExtendedTree& base, const JointSeries& x,
               const double* p) {
  switch (effect.info().port) {
    case Port::kModelParameter: {
      Tree<double> changed = base.tree;
      add_to_tree(effect, p, changed);
      if (base.loops)  // joint by joint, so that what a plane hides is exactly 0
        return rnea_batch(changed, x.q, x.qd, x.qdd) - rnea_batch(base.tree, x.q, x.qd, x.qdd);
      return rnea_batch(changed, x.q, x.qd, x.qdd) - x.tau - rotor_torque(base.tree, x);
    }
    case Port::kMeasurement: {
      JointSeries truth = true_motion(effect, x, p);
      const AtDrives of_truth(base, truth);
      truth.tau = link_torque(base, truth, of_truth);
      return local_total(base, truth, of_truth) -
             (x.total.size() > 0 ? x.total : local_total(base, x, {base, x}));
    }
    case Port::kMemory:
      return memory_torque(effect, base, x, p);
    case Port::kJointTorque:
    case Port::kLinkForce:
    case Port::kBallForce:  // no torque
    case Port::kBallImpact:
    case Port::kBallView:
    case Port::kStringAnchor:
    case Port::kStringContact:
      break;
  }
  Rows out = Rows::Zero(x.rows(), x.q.cols());
  add_local(effect, base.tree, x, p, out);
  return out;
}

/// True where the log has the motor's angle: no linear parameter counts.
bool reads_motor(const BoundEffect& effect, const double* p) {
  return visit_formula(effect, [&](const auto& formula) {
    if constexpr (requires { formula.encoder_at_motor(p); }) return formula.encoder_at_motor(p);
    return false;
  });
}

/// Torques at parameters, each computed once.
class Torques {
 public:
  Torques(const BoundEffect& effect, const ExtendedTree& base, const JointSeries& x)
      : effect_(effect), base_(base), x_(x) {}
  const Rows& operator()(const std::vector<double>& p) {
    for (const auto& [at, torque] : known_)
      if (at == p) return torque;
    return known_.emplace_back(p, torque_of(effect_, base_, x_, p.data())).second;
  }

 private:
  const BoundEffect& effect_;
  const ExtendedTree& base_;
  const JointSeries& x_;
  std::deque<std::pair<std::vector<double>, Rows>> known_;
};

/// One unit of linear parameter k, the other linear ones 0.
Rows unit_column(const BoundEffect& effect, const ExtendedTree& base, const JointSeries& x,
                 std::vector<double> p, int k, Torques& torque) {
  for (const int i : effect.linear_parameters()) p[static_cast<std::size_t>(i)] = 0.0;
  if (reads_motor(effect, p.data())) return Rows::Zero(x.rows(), x.q.cols());
  const std::vector<double> none = p;
  p[static_cast<std::size_t>(k)] = 1.0;
  // Friction that follows a hidden motor stays where the rotor has no inertia.
  if (effect.info().port == Port::kMemory && !base.effects.empty()) return torque(p) - torque(none);
  return torque(p);
}

/// Shape parameter k of an effect of one instant, by Jets through its formula.
Rows jet_column(const BoundEffect& effect, const ExtendedTree& base, const JointSeries& x,
                const std::vector<double>& p, int k) {
  const int n = static_cast<int>(x.q.cols());
  std::vector<JetD> jets(p.begin(), p.end()), state(static_cast<std::size_t>(4 * n)),
      tau(static_cast<std::size_t>(n));
  const auto at = static_cast<std::size_t>(k);
  jets[at].v[0] = scale(effect.parameter_info[at]) == Scale::kLog ? p[at] : 1.0;
  Rows out(x.rows(), n);
  for (long row = 0; row < x.rows(); ++row) {
    for (int j = 0; j < n; ++j) {
      const auto i = static_cast<std::size_t>(j), m = static_cast<std::size_t>(n);
      state[i] = JetD(x.q(row, j));
      state[m + i] = JetD(x.qd(row, j));
      state[2 * m + i] = JetD(x.qdd(row, j));
      state[3 * m + i] = JetD(x.tau(row, j));
    }
    std::ranges::fill(tau, JetD(0.0));
    const JointSample<JetD> s{x.start + static_cast<double>(row) * x.dt,
                              x.run,
                              state.data(),
                              state.data() + n,
                              state.data() + 2 * n,
                              state.data() + 3 * n};
    add_torque(effect, base.tree, s, jets.data(), tau.data());
    for (int j = 0; j < n; ++j) out(row, j) = tau[static_cast<std::size_t>(j)].v[0];
  }
  return out;
}

/// Shape parameter k by differences of order two; of order one, from one side, where a parameter
/// must not fall below 0.
Rows difference_column(const BoundEffect& effect, const std::vector<double>& p, int k,
                       Torques& torque) {
  const auto at = static_cast<std::size_t>(k);
  const ParameterInfo& info = effect.parameter_info[at];
  const bool log = scale(info) == Scale::kLog;
  // Cuts the error of the difference, of order h², to 1e-8 and leaves rounding at 1e-16/h.
  const double size = std::max(1.0, std::abs(p[at])), h = log ? 1e-4 : 1e-5 * size,
               one_sided = 1e-6 * size;
  const auto moved = [&](double step) {
    std::vector<double> to = p;
    to[at] = log ? p[at] * std::exp(step) : p[at] + step;
    return to;
  };
  if (info.sign == Sign::kNonNegative && p[at] < h)
    return (torque(moved(one_sided)) - torque(p)) / one_sided;
  return (torque(moved(h)) - torque(moved(-h))) / (2.0 * h);
}

}  // namespace

void predict(const ExtendedTree& base, JointSeries& x) {
  const AtDrives at_drives(base, x);
  x.tau = link_torque(base, x, at_drives);
  x.total = local_total(base, x, at_drives);
  x.inertia.resize(x.rows(), x.q.cols());
  for (int j = 0; j < x.q.cols(); ++j) x.inertia.col(j) = link_inertia(base.tree, x, j);
}

Rows series_torque(const BoundEffect& effect, const ExtendedTree& base, const JointSeries& x,
                   const double* p) {
  return torque_of(effect, base, *Complete(effect, base, x), p);
}
Rows series_torque(const BoundEffect& effect, const Tree<double>& tree, const JointSeries& x,
                   const double* p) {
  return series_torque(effect, ExtendedTree{tree, {}, {}}, x, p);
}

std::vector<Rows> series_columns(const BoundEffect& effect, const ExtendedTree& base,
                                 const JointSeries& x, const double* p,
                                 const std::vector<int>& which, Rows* at_p) {
  const Complete complete(effect, base, x);
  const JointSeries& full = *complete;
  const std::vector<double> at(p, p + effect.parameters.size());
  Torques torque(effect, base, full);
  std::vector<Rows> out;
  for (const int k : which) {
    if (k < 0 || k >= static_cast<int>(at.size()))
      throw ShapeError("series_columns: parameter " + std::to_string(k) + " of " +
                       effect.info().name + ", which has " + std::to_string(at.size()));
    if (effect.parameter_info[static_cast<std::size_t>(k)].linear)
      out.push_back(unit_column(effect, base, full, at, k, torque));
    else if (effect.is_local())
      out.push_back(jet_column(effect, base, full, at, k));
    else
      out.push_back(difference_column(effect, at, k, torque));
  }
  if (at_p) *at_p = torque(at);
  return out;
}
std::vector<Rows> series_columns(const BoundEffect& effect, const Tree<double>& tree,
                                 const JointSeries& x, const double* p,
                                 const std::vector<int>& which) {
  return series_columns(effect, ExtendedTree{tree, {}, {}}, x, p, which);
}

}  // namespace diffnea
