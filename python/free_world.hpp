#pragma once
/// Bodies and constraints some of whose numbers are free, for fit_constrained.

#include <string>
#include <vector>

#include <diffnea/identify/constrained_loss.hpp>
#include <diffnea/model/physical.hpp>

#include "constraint_world.hpp"

namespace diffnea::python {

/// Numbers that may be free are named
///
///     rod.length   rod.p_AP[0]   hinge.X_AJ.rx … .z
///     bodies[0].mass   bodies[0].com[0]   bodies[0].inertia.Ixx … .Izz
///
/// A pose's are the turn and shift ξ of X exp(ξ). A rigid body's mass takes the inertia with it,
/// and its centre of mass all of the body. Its inertia about the centre of mass is free in
/// log-Cholesky coordinates, which reach possible bodies alone (model/physical.hpp); single entries
/// of it are free as they are.
class FreeWorld {
 public:
  /// @param free  names of numbers, or of what holds them: "rod", "rod.p_AP", "bodies[0]"
  /// @throws Error if one names nothing that may be free, with the choices; ModelError if an
  ///         inertia is free that no body has
  FreeWorld(std::vector<Body> bodies, std::vector<NamedConstraint> constraints,
            const std::vector<std::string>& free);

  /// The free numbers, and where they begin.
  const std::vector<ConstrainedParameter>& parameters() const { return parameters_; }

  /// Bodies and rows of a system whose states are given.
  template <class T>
  void fill(const VecX<T>& p, ConstrainedSystem<T>& system) const {
    for (std::size_t b = 0; b < bodies_.size(); ++b)
      system.bodies.push_back({bodies_[b].kind, inertia_at(b, p)});
    for (std::size_t c = 0; c < constraints_.size(); ++c)
      append(constraints_[c], numbers_at(c, p), system.states, system.rows);
  }

  /// The free numbers as people read them: of an inertia the entries about the centre of mass, in
  /// place of its coordinates [kg·m²].
  template <class T>
  VecX<T> readable(const VecX<T>& p) const {
    VecX<T> out = p;
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      if (!has_coordinates(b)) continue;
      const Sym3<T> I = inertia_about_com(inertia_at(b, p));
      out.segment(place_[of_body_[b] + kInertia], 6) << I.xx, I.xy, I.xz, I.yy, I.yz, I.zz;
    }
    return out;
  }

  /// Bodies and constraints with free numbers p.
  ///@{
  std::vector<Body> bodies_at(const VecX<double>& p) const;
  std::vector<NamedConstraint> constraints_at(const VecX<double>& p) const;
  ///@}

 private:
  /// Where a body's numbers lie, from its first: mass, centre of mass, inertia.
  static constexpr std::size_t kMass = 0, kCom = 1, kInertia = 4;

  void list_body(std::size_t b);
  void list_constraint(const NamedConstraint& c);
  void set_free(const std::vector<std::string>& free);
  void set_coordinates(std::size_t b);

  /// All of a body's inertia is free: its six numbers are log-Cholesky coordinates.
  bool has_coordinates(std::size_t b) const { return has_coordinates_[b]; }
  template <class T>
  T number(std::size_t k, const VecX<T>& p) const {
    return place_[k] < 0 ? T(all_[k].value) : p[place_[k]];
  }
  template <class T>
  SpatialInertia<T> inertia_at(std::size_t b, const VecX<T>& p) const {
    SpatialInertia<T> out{};
    if (bodies_[b].kind == BodyKind::kPrescribed) return out;
    const auto at = [&](std::size_t k) { return number(of_body_[b] + k, p); };
    out.m = at(kMass);
    if (bodies_[b].kind == BodyKind::kParticle) return out;
    const Vec3<T> com{at(kCom), at(kCom + 1), at(kCom + 2)};
    if (!has_coordinates(b)) {
      const T growth = out.m / T(bodies_[b].theta[0]);
      const auto entry = [&](std::size_t k) {
        const T x = at(kInertia + k);
        return place_[of_body_[b] + kInertia + k] < 0 ? growth * x : x;
      };
      return inertia_from_com(out.m, com,
                              {entry(0), entry(1), entry(2), entry(3), entry(4), entry(5)});
    }
    Theta<T> theta{T(0.0)};
    for (std::size_t k = 0; k < 6; ++k) theta[1 + k] = at(kInertia + k);
    theta[7] = com.x, theta[8] = com.y, theta[9] = com.z;
    theta = theta_from_log_cholesky(theta);  // a body of 1 kg
    for (T& x : theta) x = x * out.m;
    return SpatialInertia<T>::from_theta(theta);
  }
  template <class T>
  std::vector<std::vector<T>> numbers_at(std::size_t c, const VecX<T>& p) const {
    const NamedConstraint& of = constraints_[c];
    std::vector<std::vector<T>> out;
    std::size_t k = of_constraint_[c];
    for (std::size_t i = 0; i < of.shapes.size(); k += of.shapes[i].unknowns(), ++i) {
      std::vector<T>& numbers = out.emplace_back();
      for (const double x : of.parameters[i]) numbers.push_back(T(x));
      const auto at = [&, k](std::size_t j) { return number(k + j, p); };
      if (!of.shapes[i].is_pose()) {
        for (std::size_t j = 0; j < numbers.size(); ++j) numbers[j] = at(j);
      } else if (std::any_of(&place_[k], &place_[k] + 6, [](int place) { return place >= 0; })) {
        const Twist<T> turned{{at(0), at(1), at(2)}, {at(3), at(4), at(5)}};
        numbers = numbers_of(pose_of(numbers) * exp(turned));
      }
    }
    return out;
  }
  std::vector<Body> bodies_;
  std::vector<NamedConstraint> constraints_;
  std::vector<ConstrainedParameter> all_;  ///< numbers that a body or constraint has
  std::vector<bool> direction_;            ///< entries of unit vectors among these: never free
  std::vector<std::size_t> of_body_, of_constraint_;  ///< first of each among them
  std::vector<bool> has_coordinates_;                 ///< per body
  std::vector<int> place_;                            ///< among the free ones; −1: fixed
  std::vector<ConstrainedParameter> parameters_;      ///< the free ones
};

}  // namespace diffnea::python
