#pragma once
/// Motion of a robot whose constraints close loops, by the joints that lead it: of those with a
/// drive, as many as constraints leave motions. All other joints follow,
///
///   q̇ = S ẏ,   S = N N_y⁻¹,   q̈ = S ÿ + the shortest x of the followers with J x = −γ
///
/// N spans the motions that constraints leave, N_y are its rows at the leading joints
/// (dynamics/driven_torques.hpp). Where the robot is, is found along the way from a posture that
/// closes: the same y may belong to several. Internal to the library.

#include <string>
#include <vector>

#include <diffnea/dynamics/tree_constraints.hpp>

namespace diffnea {

/// Diagonal of N (Nᵀ M N)⁻¹ Nᵀ, (n): acceleration of each joint by a torque of one there.
/// @param M  of the tree, (n × n)
VecX<double> loop_mobility(const Tree<double>& tree, const TreeConstraints<double>& constraints,
                           const VecX<double>& q, const MatX<double>& M);

class LoopMotion {
 public:
  /// The joints with a drive that are closest to the motions at the home posture lead.
  /// @param where  who asks, for messages
  /// @throws ModelError if a wheel rolls, whose place no joint tells; if no posture near where the
  ///         joints rest closes the loops; if fewer joints are driven than constraints leave
  ///         motions
  LoopMotion(std::string where, const Model& model);

  int num_joints() const { return tree_.num_dofs(); }
  const std::vector<int>& drives() const { return drives_; }  ///< joints with a motor
  const std::vector<int>& leads() const { return leads_; }    ///< some of these: as many as motions
  bool leads(int joint) const;
  /// A closed posture (n): the nearest to where the joints rest.
  const VecX<double>& home() const { return home_; }
  VecX<double> positions_of_leads(const VecX<double>& q) const { return q(leads_); }

  /// Turns the followers until the loops close with the leading joints at `y`.
  /// @param q  a posture nearby; overwritten by the closed one
  /// @return whether they do, without a jump to another way of assembling the loop
  bool close(const VecX<double>& y, VecX<double>& q) const;
  /// The same along the straight way of the leading joints from the closed posture `q` to `y`.
  /// @param q  overwritten by the last posture that closes and is no dead point
  bool move(const VecX<double>& y, VecX<double>& q) const;
  /// Moves a state that has drifted, (n) each, to the nearest that satisfies the constraints.
  /// @return whether the loops close there
  bool hold(VecX<double>& q, VecX<double>& qd) const;

  /// Velocities and accelerations (n) from those of the leading joints in them.
  /// @return how firmly the leading joints hold the robot: least length of a motion of unit length
  ///         at them; 0 at a dead point, and then both are left as they are
  double follow(const VecX<double>& q, VecX<double>& qd, VecX<double>& qdd) const;
  /// Rows of all joints (N, n) from those of the leading joints in them.
  /// @param posture  closed and near the first row; overwritten by the last that closes
  /// @param least    firmness (`follow`) from which on a row counts as held
  /// @return rows that close and are held, from the first; N: all of them
  long follow(RowMatX<double>& q, RowMatX<double>& qd, RowMatX<double>& qdd, VecX<double>& posture,
              double least) const;

  /// D, (drives × n): torques of the drives from those of the tree; no rows at a dead point.
  MatX<double> torque_map(const VecX<double>& q) const;
  /// The same for the leading joints alone, (leads × n), as if no other were driven.
  MatX<double> lead_map(const VecX<double>& q) const;
  /// Torques of the tree (n) as the drives have to give them; those of the others are zero.
  /// @return empty at a dead point
  VecX<double> at_drives(const VecX<double>& q, const VecX<double>& tau) const;
  /// loop_mobility() of this robot.
  VecX<double> mobility(const VecX<double>& q, const MatX<double>& M) const {
    return loop_mobility(tree_, constraints_, q, M);
  }

  const TreeConstraints<double>& constraints() const { return constraints_; }
  /// Names the constraint that is furthest from closing at `q`, and by how much.
  std::string gap_text(const VecX<double>& q) const;
  /// "j1 = 0.4, j2 = -1.2": the leading joints of a posture.
  std::string leads_text(const VecX<double>& q) const;

 private:
  void find_home(const Model& model);
  void choose_leads();
  MatX<double> jacobian(const VecX<double>& q) const;
  /// Smallest singular value of N_y, and S. @param S  (n × leads), not written at a dead point
  double slopes(const VecX<double>& q, MatX<double>& S) const;
  double follow(const VecX<double>& q, VecX<double>& qd, VecX<double>& qdd, MatX<double>& S) const;

  std::string where_;
  std::string name_;
  std::vector<std::string> joints_;
  Tree<double> tree_;
  TreeConstraints<double> constraints_;
  std::vector<int> drives_, leads_;
  VecX<double> home_;
};

}  // namespace diffnea
