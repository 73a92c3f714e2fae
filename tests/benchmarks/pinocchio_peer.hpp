#pragma once
/// Pinocchio behind plain pointers: its headers want another compiler, and bring their own Eigen.

#include <memory>
#include <vector>

namespace diffnea::test {

/// One link of a chain or tree whose joints all turn about z, but for a free base.
struct PeerLink {
  int parent;
  double R_PJ[9], p_PJ[3];  ///< row-major
  double mass, p_com[3], I_com[9], armature;
};

class PinocchioPeer {
 public:
  /// Gravity −9.81 along z. @param free_base  link 0 floats: q as ours, its twist and wrench with
  /// the linear half first
  explicit PinocchioPeer(const std::vector<PeerLink>& links, bool free_base = false);
  ~PinocchioPeer();
  /// Results stay readable until the next call.
  const double* rnea(const double* q, const double* qd, const double* qdd);
  const double* aba(const double* q, const double* qd, const double* tau);
  const double* mass_matrix(const double* q);
  void rnea_derivatives(const double* q, const double* qd, const double* qdd);
  void aba_derivatives(const double* q, const double* qd, const double* tau);
  void torque_regressor(const double* q, const double* qd, const double* qdd);
  static const char* version();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace diffnea::test
