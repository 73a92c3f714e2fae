#pragma once
/// A pack of arms in motion: where their links are and how they move. Included by what
/// pack_world.cpp is made of, once per instruction set.

#include <vector>

#include <diffnea/core/pack.hpp>
#include <diffnea/dynamics/aba.hpp>

namespace diffnea {

/// What the recursions take for joint_pose where links are of packs: libstdc++'s sine and
/// cosine are two range reductions where one does.
template <int K>
Pose<Pack> joint_pose(const Link<Pack>& link, RevoluteAxis<K>, const Pack& q) {
  constexpr int i = (K + 1) % 3, j = (K + 2) % 3;
  Pack s, c;
  sin_cos(q, s, c);
  const Mat3<Pack>& R0 = link.X_PJ.R;
  Pose<Pack> X;
  X.R.col[K] = R0.col[K];
  X.R.col[i] = R0.col[i] * c + R0.col[j] * s;
  X.R.col[j] = R0.col[j] * c - R0.col[i] * s;
  X.p = link.X_PJ.p;
  return X;
}

}  // namespace diffnea

namespace diffnea::sim {
namespace DIFFNEA_ISA {

struct PackArm {
  Tree<Pack> tree;
  AbaStates<Pack, Pack> ws;  ///< twists in their links
  std::vector<Pose<Pack>> X_WL;

  /// Poses and twists at (q, q̇): wherever the arm was moved, this follows.
  void outward(const std::vector<Pack>& q, const std::vector<Pack>& qd) {
    const int n = static_cast<int>(q.size());
    X_WL.resize(q.size());
    call_inlined<Pack>([&] {
      diffnea::detail::aba_outward(std::false_type{}, tree, q.data(), qd.data(), ws);
      for (int i = 0; i < n; ++i) {
        const int parent = tree.links[i].parent;
        X_WL[i] = parent < 0 ? ws.links[i].X_PL : X_WL[parent] * ws.links[i].X_PL;
      }
    });
  }
};

}  // namespace DIFFNEA_ISA
}  // namespace diffnea::sim
