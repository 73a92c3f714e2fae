# What Doxygen reads in place of a header (INPUT_FILTER of docs/Doxyfile). Lines stay what they are, so that its warnings
# name the right ones.

# The comment below `#pragma once` is the file's.
s|^#pragma once|///@file|

# Members that effects have by contract (effects/effect.hpp, effects/memory.hpp, effects/ball_effect.hpp): one sentence each for all effects.
# What has a comment of its own keeps that.
/^ *\/\/\/</b
/^ *\/\/\//{
  :comment
  n
  /^ *\/\/\//b comment
  b
}
/^  template </N
s|^  static const EffectInfo& info()|  /** What the catalogue says of it: name, formula, place, port and parameters. */ &|
s|^  template <.*>\n  void add_torque(const JointSample<|  /** Adds its torque at one instant to `tau`, by joint [N·m] or [N]; `joint`: those it acts on; `p`: in the order of info(). */ &|
s|^  template <.*>\n  void add_torque(const Tree<|  /** Adds the torques of its force on the link that `joint` moves to `tau`, by joint [N·m] or [N]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  void add_to_tree(|  /** Adds what it changes to the link tree; `joint`: the one that moves its link; `p`: in the order of info(). */ &|
s|^  void add_to_motion(|  /** Turns the motion of `joint` in `truth` from what was logged into what it was; `x`: the stretch as logged; `p`: in the order of info(). */ &|
s|^  VecX<double> torque_series(|  /** (N) torque in addition at `joint` along a stretch [N·m] or [N]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  static StateRate<T> derivative(|  /** Rate of the state `z` at the velocity `qd`; `p`: in the order of info(). */ &|
s|^  template <.*>\n  static T torque(|  /** Torque at the state `z` and its rate `zd` [N·m] or [N], linear in both; `p`: in the order of info(). */ &|
s|^  template <.*>\n  static AtRest<T> at_rest(|  /** Spring and damper that the state is about rest; `p`: in the order of info(). */ &|
s|^  static double advance(double z, const Move|  /** The state after a move at constant velocity, in closed form; `p`: in the order of info(). */ &|
s|^  template <.*>\n  static MotorSpring<T> motor_spring(|  /** Spring, damper and inertia of the hidden motor; `p`: in the order of info(). */ &|
s|^  static double transmitted(|  /** Torque that the hidden motor transmits, by its angle and velocity beyond the link's; `p`: in the order of info(). */ &|
s|^  static double deflection_at(|  /** Angle of the hidden motor beyond the link's that holds a torque at rest; `p`: in the order of info(). */ &|
s|^  template <.*>\n  static void add_to_drive(|  /** Adds to limit, delay and lag between command and torque; `p`: in the order of info(). */ &|
s|^  static void add_to_encoder(|  /** Adds to the scale and offset of an encoder's reading; `p`: in the order of info(). */ &|
s|^  static double clock_shift(|  /** How much later the motion is logged than the torque [s]; `p`: in the order of info(). */ &|
s|^  static VecX<double> logged_velocity(|  /** (N) velocities as the log has them; `p`: in the order of info(). */ &|
s|^  template <.*>\n  void add_acceleration(|  /** Adds its acceleration of the ball to `a`, in W [m/s²]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  void change_view(|  /** Moves the place at which the camera sees the ball [m]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  T delay(|  /** How late the camera's picture is [s]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  void add_to_anchor(|  /** Moves the place on the link at which the string is tied, in the link's frame [m]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  StringRoute<T> route(|  /** The way that the string takes around the cup, in the half plane of the cup's axis and the ball; `p`: in the order of info(). */ &|
s|^  template <.*>\n  T rebound(|  /** Restitution of the impact as the string becomes taut; `p`: in the order of info(). */ &|
