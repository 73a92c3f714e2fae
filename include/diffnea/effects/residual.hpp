#pragma once

#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/effect.hpp>
#include <diffnea/model/model.hpp>

namespace diffnea {

/// residual: a torque that has no name, as a table that `diagnose` has learned of it: a sum of
/// bumps over one or two channels of the motion, any joint's. No physics: it says how much, not
/// why.
///
/// Bumps are cubic B-splines, β(u) = ¼ [(2 − |u|)₊³ − 4 (1 − |u|)₊³] (de Boor 1978), 0 from |u| = 2
/// on: two widths from where the last one is centred, the torque is 0, and nowhere more than
/// `bound`.
struct Residual {
  /// A channel that the torque depends on: position or velocity of a degree of freedom.
  struct Axis {
    bool velocity = false;  ///< q̇ of the joint; otherwise q
    int joint = -1;         ///< degree of freedom
  };
  std::vector<Axis> axes;  ///< one or two, those of table.variables
  BumpTable table;         ///< centres, widths and weights of the bumps

  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "residual",
        .formula = "scale sum_b w_b prod_k bump((x_k - c_bk)/h_bk)",
        .summary = "what no effect explains, learned as a table; no physics",
        .place = Place::kJoint,
        .parameters = {{.name = "scale", .unit = "1", .unit_prismatic = "1", .initial = 1.0}},
        .traits = {Trait::kIfAsked}};
    return kInfo;
  }

  /// The channels of a table on a model's joints.
  /// @throws ModelError naming `here` if a channel is none, or the table's numbers do not fit
  static Residual from(const BumpTable& table, const std::vector<std::string>& joints,
                       const std::string& here);

  /// Takes the table of the spec.
  /// @throws ModelError if there is none, or it acts on more than one joint
  void complete(const BoundSetting& setting);

  /// Degrees of freedom whose motion the table is over.
  std::vector<int> joints_read() const {
    std::vector<int> out;
    for (const Axis& a : axes)
      if (std::ranges::find(out, a.joint) == out.end()) out.push_back(a.joint);
    return out;
  }

  /// 1 at the centre, ¼ one width from it; NaN stays NaN.
  template <Scalar T>
  static T bump(const T& u) {
    using std::abs;
    const auto cube_above = [](const T& a) {
      const T positive = select(value(a) < 0.0, T(0.0), a);
      return positive * positive * positive;
    };
    const T a = abs(u);
    return T(0.25) * (cube_above(T(2.0) - a) - T(4.0) * cube_above(T(1.0) - a));
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    const std::size_t n = axes.size();
    T f(0.0);
    for (std::size_t b = 0; b < table.weights.size(); ++b) {
      T product(table.weights[b]);
      for (std::size_t k = 0; k < n; ++k) {
        const T& at = (axes[k].velocity ? x.qd : x.q)[axes[k].joint];
        product =
            product * bump((at - T(table.centres[b * n + k])) * T(1.0 / table.widths[b * n + k]));
      }
      f = f + product;
    }
    const T most(table.bound);
    f = select(value(f) > table.bound, most, select(value(f) < -table.bound, -most, f));
    tau[*joint] += p[0] * f;
  }
};

}  // namespace diffnea

#ifndef DIFFNEA_COMPILED
#include <diffnea/effects/detail/residual_impl.hpp>
#endif
