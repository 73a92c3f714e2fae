#include "motion/path.hpp"

#include <array>
#include <complex>
#include <limits>

#include <diffnea/effects/position_servo.hpp>
#include <diffnea/effects/stepping.hpp>

namespace diffnea {
namespace {

/// Speed at rest [rad/s] or [m/s], where no friction is sharper, else share of the speed at which
/// it turns: a secant from there is the slope of friction.
constexpr double kSlow = 1e-6, kSlowShare = 0.01;
/// Speed over that at which dry friction turns, from which on it is flat: tanh(5) is 1 but for
/// 1e-4.
constexpr double kFlat = 5.0;
/// Step times the frequency of a joint that a drive without bounds leads [rad]: it forgets within a
/// radian or two, and what it is off by is 1e-5 of its motion, less than an encoder's step is. At
/// bounds, and beside friction that follows the load, a step is no longer of fourth order.
constexpr double kLedPhase = 0.2;

}  // namespace

MotionPath::MotionPath(ExtendedTree model, const SteppingOptions& options, int first)
    : options_(options),
      rotors_(model),
      dynamics_(std::move(model)),
      first_joint_(first),
      n_(dynamics_.num_dofs()) {
  sharp_ = VecX<double>::Constant(n_, std::numeric_limits<double>::infinity());
  for (const BoundEffect& e : dynamics_.model().effects) {
    dry_ = dry_ || e.info().reads != Reads::kNothing;
    for (std::size_t k = 0; k < e.parameters.size(); ++k)
      if (e.parameter_info[k].name == "smoothing")
        for (const int j : e.joints) sharp_[j] = std::min(sharp_[j], e.parameters[k]);
  }
  slow_ = (kSlowShare * sharp_).cwiseMin(kSlow);
  damping_ = moving_ = resting_ = probe_ = still_ = qdd_ = change_ = holding_ =
      VecX<double>::Zero(n_);
}

/// Torques of the effects of one instant, over the gains; of those that read q̈ or the transmitted
/// torque, at the present ones.
void MotionPath::friction(const double* q, const double* qd, int run, VecX<double>& tau) {
  tau.setZero();
  JointSample<double> x;
  x.time = dynamics_.time();
  x.run = run;
  x.command = dynamics_.command();
  x.step = dynamics_.step();
  x.q = q;
  x.qd = qd;
  x.qdd = qdd_.data();
  x.tau = dynamics_.is_implicit() ? dynamics_.transmitted().data() : q;  // else unread
  for (const BoundEffect& e : dynamics_.model().effects)
    if (!e.is_gear) add_torque(e, dynamics_.model().tree, x, e.parameters.data(), tau.data());
  tau.array() /= dynamics_.gains().array();
}

const CommandPath* MotionPath::led(const std::shared_ptr<const CommandPath>& command) {
  if (!command) return nullptr;
  if (told_ != command) {
    led_ = command->of_joints(first_joint_, rotors_.joints());
    led_.add_copies(rotors_.joints_behind());
    for (const DriveIntegrator& i : rotors_.integrators())
      led_.set_integrator(rotors_.drive(i.joint), i.dof);
    for (const BoundEffect& e : dynamics_.model().effects) lead_command(e, led_);
    told_ = command;
  }
  return &led_;
}

VecX<double> MotionPath::first_state(const VecX<double>& read, const VecX<double>& pushes) {
  if (rotors_.dofs() == rotors_.joints()) return read;
  const int n = rotors_.joints();
  VecX<double> out = VecX<double>::Zero(2 * n_);  // integrators begin at 0
  for (const int half : {0, 1}) {
    out.segment(half * n_, n) = read.segment(half * n, n);
    for (const HiddenRotor& r : rotors_.rotors())
      out[half * n_ + r.rotor] = read[half * n + r.joint];
  }
  VecX<double> load =
      rnea<double, double>(dynamics_.model().tree, out.head(n_), out.tail(n_), still_, rnea_ws_);
  load.head(n) -= pushes;
  for (const HiddenRotor& r : rotors_.rotors())
    out[r.hidden()] += (r.read ? -1.0 : 1.0) * deflection_at(r.gear, load[r.joint]);
  return out;
}

VecX<double> MotionPath::own_state(const MotionWindow& window) const {
  const long n = rotors_.joints();
  VecX<double> out(2 * n);
  out << window.state.segment(first_joint_, n),
      window.state.segment(window.state.size() / 2 + first_joint_, n);
  return out;
}

VecX<double> MotionPath::first_state(const MotionStretch& stretch, const MotionWindow& window) {
  VecX<double> out = first_state(own_state(window), pushes(stretch, window.first));
  for (const DriveIntegrator& i : rotors_.integrators())
    out[n_ + i.dof] = summed_before(i, stretch, window).a;
  return out;
}

JetD MotionPath::summed_before(const DriveIntegrator& integrator, const MotionStretch& stretch,
                               const MotionWindow& window) {
  const CommandPath* path = led(stretch.command);
  JetD sum(0.0);
  if (!path) return sum;
  const int drive = rotors_.drive(integrator.joint);
  std::array<JetD, 7> p;
  for (std::size_t k = 0; k < p.size(); ++k)
    p[k] = JetD(path->servo(drive)[k], static_cast<int>(k));
  const JetD rate(path->integral_rate(drive), 7);
  const int column = first_joint_ + integrator.joint;
  double last = stretch.q(0, column);
  for (long k = 0; k < window.first; ++k) {
    const SimulationStep row{stretch.time[static_cast<std::size_t>(k)],
                             stretch.time[static_cast<std::size_t>(k) + 1]};
    const double middle = 0.5 * (row.from + row.to), next = stretch.q(k + 1, column),
                 read = std::isnan(next)   ? last
                        : std::isnan(last) ? next
                                           : 0.5 * (last + next);
    if (!std::isnan(next)) last = next;
    if (!std::isnan(read) && path->is_on(drive, middle, row))
      sum += JetD(row.to - row.from) * PositionServo::summed(*path, drive, middle, row, JetD(read),
                                                             JetD(rate * sum), p.data());
  }
  return sum;
}

/// Longest step that the gears' own swings allow [s], at the inverse mass matrix of the last
/// linearisation.
double MotionPath::step_of_gears() const {
  // Phase of a swing that a log hardly shows and that dies down [rad]: it is off by 5e-4 of it.
  constexpr double kPhase = 0.5;
  double out = std::numeric_limits<double>::infinity();
  const RowMatX<double>& mobility = dynamics_.inverse_mass_matrix();
  for (const HiddenRotor& r : rotors_.rotors()) {
    const MotorSpring<double> s = motor_spring(r.gear);
    const double light = mobility(r.joint, r.joint) + mobility(r.rotor, r.rotor);
    out = std::min({out, kPhase / std::sqrt(s.stiffness * light),
                    options_.max_step / std::max(s.damping * light, 1e-300)});
  }
  return out;
}

/// Longest step that the swings of joints allow [s], each with its rotor, at the last
/// linearisation, drives on and off their bounds. A joint that its drive brakes beyond its swing
/// creeps after the command: what is faster is over within a step.
double MotionPath::step_of_swings() const {
  const int n = rotors_.joints();
  MatX<double> together = MatX<double>::Zero(n_, n);  // gears do not wind up
  for (int j = 0; j < n; ++j) together(j, j) = 1.0;
  for (const HiddenRotor& r : rotors_.rotors()) together(r.rotor, r.joint) = 1.0;
  const MatX<double> mass = dynamics_.inverse_mass_matrix().inverse();
  MatX<double> stiffness = -together.transpose() * mass * dynamics_.dqdd_dq() * together;
  VecX<double> damping = VecX<double>::Zero(n);
  bool forgets = dynamics_.command() != nullptr && !dynamics_.is_implicit();
  if (dynamics_.command())
    for (const BoundEffect& e : dynamics_.model().effects) {
      const int dof = e.joints.empty() ? -1 : e.joints.front();
      const double slope = drive_slope(e, led_);
      if (!(slope > 0.0) || led_.sums(dof) >= 0) continue;  // else it is the integrator's
      const int joint = rotors_.joint_of(dof);
      stiffness(joint, joint) += slope;
      damping[joint] += led_.servo(dof)[1];
      forgets = forgets && !PositionServo::has_bounds(led_.servo(dof));
    }
  MatX<double> flow = MatX<double>::Zero(2 * n, 2 * n);
  const Eigen::LLT<MatX<double>> factor(together.transpose() * mass * together);
  flow.topRightCorner(n, n).setIdentity();
  flow.bottomLeftCorner(n, n) = -factor.solve(stiffness);
  flow.bottomRightCorner(n, n) = -factor.solve(MatX<double>(damping.asDiagonal()));
  std::vector<double> real;
  double fastest = 0.0;
  for (const std::complex<double>& z : flow.eigenvalues()) {
    if (z.imag() != 0.0)
      fastest = std::max(fastest, std::abs(z));
    else
      real.push_back(std::abs(z.real()));
  }
  std::ranges::sort(real);
  if (!real.empty()) fastest = std::max(fastest, real[(real.size() - 1) / 2]);
  return (forgets ? kLedPhase : options_.max_phase) / std::max(fastest, 1e-300);
}

/// Bound on the rate of friction at rest, where dry friction is steepest [1/s]; sets the longest
/// step that the motion allows, too.
double MotionPath::finest_rate(const MotionStretch& stretch, const MotionWindow& window) {
  const VecX<double> q = first_state(own_state(window), pushes(stretch, window.first)).head(n_),
                     rest = VecX<double>::Zero(n_);
  VecX<double> u;
  act(stretch, logged(stretch, window.first), u);
  dynamics_.set_command(led(stretch.command));
  dynamics_.set_time(stretch.time[static_cast<std::size_t>(window.first)]);
  const long moving = n_ - static_cast<long>(rotors_.integrators().size());  // no friction there
  double rate = 0.0;
  for (const double side : {-1.0, 0.0}) {  // friction may be of another size on each
    const VecX<double> speed = side * slow_;
    dynamics_.linearise(q.data(), speed.data(), u.data(), stretch.run);
    if (dry_)
      rate = std::max(rate,
                      dynamics_.dqdd_dqd().leftCols(moving).cwiseAbs().rowwise().sum().maxCoeff());
  }
  if (dynamics_.command()) {  // drives at their steepest, not as they are at this command
    dynamics_.set_command(nullptr);
    dynamics_.linearise(q.data(), rest.data(), u.data(), stretch.run);
    dynamics_.set_command(&led_);
  }
  longest_ = std::min(step_of_gears(), step_of_swings());
  return rate;
}

/// Tells whether a joint is beyond where its friction is steep.
bool MotionPath::moves(const MatX<double>& A, int joint) const {
  return std::abs(A(n_ + joint, 0)) > kFlat * sharp_[joint];
}

/// Change of the velocities over a step, at the present q̈ and mass matrix, with these dampers.
void MotionPath::set_change(double step, const VecX<double>& damping) {
  W_ = mass_;
  W_.diagonal() += step * damping;
  factor_.compute(W_);
  change_.noalias() = step * (mass_ * qdd_);
  factor_.solveInPlace(change_);
}

/// Longest step that leads over no reversal [s], where dry friction reads velocities, if that is
/// less than `step`, at the present q̈, mass matrix and D: a joint that friction or its drive holds
/// gets no further than they let it, however large q̈ is.
double MotionPath::step_to_turn(const MatX<double>& A, int run, double step) {
  constexpr int kMostTries = 30;
  const double *q = A.data(), *qd = A.data() + n_;
  const auto reach = [&](int j) {
    return (qd[j] * change_[j] < 0.0 ? kBrakes : kTurns) * std::max(std::abs(qd[j]), sharp_[j]);
  };
  set_change(step, damping_);
  holding_ = damping_;
  probe_ = A.col(0).tail(n_);
  bool rests = false;
  for (int j = 0; j < n_; ++j)
    if (!moves(A, j) && std::isfinite(sharp_[j])) {
      probe_[j] += std::copysign(reach(j), change_[j]);
      rests = true;
    }
  if (rests) {  // friction where a joint would get to is what holds it
    friction(q, probe_.data(), run, moving_);
    friction(q, qd, run, resting_);
    for (int j = 0; j < n_; ++j)
      if (const double by = probe_[j] - qd[j]; by != 0.0)
        holding_[j] = std::max((moving_[j] - resting_[j]) / by, 0.0);
    set_change(step, holding_);
  }
  for (int tries = 0; tries < kMostTries; ++tries) {
    double share = 1.0;
    for (int j = 0; j < n_; ++j)
      if (!moves(A, j) || qd[j] * change_[j] < 0.0)  // else it comes to no reversal
        share = std::min(share, reach(j) / std::max(std::abs(change_[j]), 1e-300));
    if (!(share < 1.0)) break;
    step *= tries == 0 ? share : kTurns * share;
    set_change(step, holding_);
  }
  return step;
}

/// Rate at which friction brakes the joints here [1/s], at the present q̈; leaves the mass matrix
/// and D.
/// @param speed  of the joints: kAtRest is where it is steepest
double MotionPath::friction_rate(const MatX<double>& A, Speed speed, int run) {
  const double* q = A.data();
  const double* qd = A.data() + n_;
  mass_ = mass_matrix<double, double>(dynamics_.model().tree, Eigen::Map<const VecX<double>>(q, n_),
                                      mass_ws_);
  for (int j = 0; j < n_; ++j)
    probe_[j] =
        speed == kAsItMoves && std::abs(qd[j]) > slow_[j] ? qd[j] : std::copysign(slow_[j], qd[j]);
  friction(q, probe_.data(), run, moving_);
  VecX<double> rest = still_;
  for (const DriveIntegrator& i : rotors_.integrators()) rest[i.dof] = probe_[i.dof];
  friction(q, rest.data(), run, resting_);
  damping_ = (moving_ - resting_).cwiseQuotient(probe_).cwiseMax(0.0);
  bool away = false;
  for (int j = 0; j < n_; ++j)
    if (speed == kAsItMoves && moves(A, j)) {
      rest[j] = 2.0 * probe_[j];
      away = true;
    }
  if (away) {  // the secant from here on: no step leads to rest
    friction(q, rest.data(), run, resting_);
    for (int j = 0; j < n_; ++j)
      if (moves(A, j)) damping_[j] = std::max((resting_[j] - moving_[j]) / probe_[j], 0.0);
  }
  // Towards rest, within the speed at which friction turns, a step may lead to the other side of
  // it, of another size. A joint that breaks away has its own.
  bool slow = false;
  for (int j = 0; j < n_; ++j)
    if (std::isfinite(sharp_[j]) && std::abs(probe_[j]) < sharp_[j] &&
        (speed == kAtRest || probe_[j] * qdd_[j] < 0.0)) {
      probe_[j] = -probe_[j];
      slow = true;
    }
  if (slow) {
    friction(q, probe_.data(), run, moving_);
    damping_ = damping_.cwiseMax((moving_ - resting_).cwiseQuotient(probe_));
  }
  factor_.compute(mass_);
  rates_ = factor_.solve(MatX<double>(damping_.asDiagonal()));
  return rates_.cwiseAbs().rowwise().sum().maxCoeff();
}

}  // namespace diffnea
