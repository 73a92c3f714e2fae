# What Doxygen reads in place of a header (INPUT_FILTER of docs/Doxyfile). Lines stay what they are, so that its warnings
# name the right ones.

# The comment below `#pragma once` is the file's.
s|^#pragma once|///@file|

# Members that effects have by contract (effects/effect.hpp, effects/ball_effect.hpp): one sentence each for all effects.
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
s|^  static constexpr bool kReadsAcceleration|  /** The formula reads q̈ or the transmitted torque: in simulation q̈ solves an equation. */ &|
s|^  static constexpr bool kNeedsAnchorJerk|  /** The formula reads x.anchor_jerk. */ &|
s|^  static constexpr bool kWhenSlack|  /** It acts while the string is slack, not while it is taut. */ &|
s|^  template <.*>\n  void add_torque(const JointSample<|  /** Adds its torque at one instant to `tau`, by joint [N·m] or [N]; `joint`: those it acts on; `p`: in the order of info(). */ &|
s|^  template <.*>\n  void add_torque(const Tree<|  /** Adds the torques of its force on the link that `joint` moves to `tau`, by joint [N·m] or [N]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  void add_to_tree(|  /** Adds what it changes to the link tree; `joint`: the one that moves its link; `p`: in the order of info(). */ &|
s|^  void add_to_motion(|  /** Turns the motion of `joint` in `truth` from what was logged into what it was; `x`: the stretch as logged; `p`: in the order of info(). */ &|
s|^  VecX<double> torque_series(|  /** (N) torque in addition at `joint` along a stretch [N·m] or [N]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  void add_acceleration(|  /** Adds its acceleration of the ball to `a`, in W [m/s²]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  void change_view(|  /** Moves the place at which the camera sees the ball [m]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  T delay(|  /** How late the camera's picture is [s]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  void add_to_anchor(|  /** Moves the place on the link at which the string is tied, in the link's frame [m]; `p`: in the order of info(). */ &|
s|^  template <.*>\n  StringRoute<T> route(|  /** The way that the string takes around the cup, in the half plane of the cup's axis and the ball; `p`: in the order of info(). */ &|
s|^  template <.*>\n  T rebound(|  /** Restitution of the impact as the string becomes taut; `p`: in the order of info(). */ &|
