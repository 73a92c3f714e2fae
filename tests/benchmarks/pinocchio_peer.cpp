#include "benchmarks/pinocchio_peer.hpp"

#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>
#include <string>

namespace diffnea::test {
namespace {

using Vector = Eigen::VectorXd;
using Row3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

}  // namespace

struct PinocchioPeer::Impl {
  pinocchio::Model model;
  pinocchio::Data data;
  Vector q, qd, x;

  static pinocchio::Model build(const std::vector<PeerLink>& links, bool free_base) {
    pinocchio::Model model;
    for (std::size_t i = 0; i < links.size(); ++i) {
      const PeerLink& l = links[i];
      const pinocchio::SE3 placement(Eigen::Map<const Row3>(l.R_PJ),
                                     Eigen::Map<const Eigen::Vector3d>(l.p_PJ));
      const auto parent = static_cast<pinocchio::JointIndex>(l.parent + 1);
      const std::string name = "j" + std::to_string(i);
      const auto id =
          free_base && i == 0
              ? model.addJoint(parent, pinocchio::JointModelFreeFlyer(), placement, name)
              : model.addJoint(parent, pinocchio::JointModelRZ(), placement, name);
      model.appendBodyToJoint(id,
                              pinocchio::Inertia(l.mass, Eigen::Map<const Eigen::Vector3d>(l.p_com),
                                                 Eigen::Map<const Row3>(l.I_com)));
    }
    for (std::size_t i = free_base ? 1 : 0; i < links.size(); ++i)
      model.armature[model.joints[i + 1].idx_v()] = links[i].armature;
    return model;
  }
  Impl(const std::vector<PeerLink>& links, bool free_base)
      : model(build(links, free_base)), data(model), q(model.nq), qd(model.nv), x(model.nv) {}

  void set(const double* q_in, const double* qd_in, const double* x_in) {
    q = Eigen::Map<const Vector>(q_in, model.nq);
    qd = Eigen::Map<const Vector>(qd_in, model.nv);
    x = Eigen::Map<const Vector>(x_in, model.nv);
  }
};

PinocchioPeer::PinocchioPeer(const std::vector<PeerLink>& links, bool free_base)
    : impl_(new Impl(links, free_base)) {}
PinocchioPeer::~PinocchioPeer() = default;

const double* PinocchioPeer::rnea(const double* q, const double* qd, const double* qdd) {
  impl_->set(q, qd, qdd);
  return pinocchio::rnea(impl_->model, impl_->data, impl_->q, impl_->qd, impl_->x).data();
}
const double* PinocchioPeer::aba(const double* q, const double* qd, const double* tau) {
  impl_->set(q, qd, tau);
  return pinocchio::aba(impl_->model, impl_->data, impl_->q, impl_->qd, impl_->x).data();
}
const double* PinocchioPeer::mass_matrix(const double* q) {
  impl_->q = Eigen::Map<const Vector>(q, impl_->model.nq);
  return pinocchio::crba(impl_->model, impl_->data, impl_->q).data();
}
void PinocchioPeer::rnea_derivatives(const double* q, const double* qd, const double* qdd) {
  impl_->set(q, qd, qdd);
  pinocchio::computeRNEADerivatives(impl_->model, impl_->data, impl_->q, impl_->qd, impl_->x);
}
void PinocchioPeer::aba_derivatives(const double* q, const double* qd, const double* tau) {
  impl_->set(q, qd, tau);
  pinocchio::computeABADerivatives(impl_->model, impl_->data, impl_->q, impl_->qd, impl_->x);
}
void PinocchioPeer::torque_regressor(const double* q, const double* qd, const double* qdd) {
  impl_->set(q, qd, qdd);
  pinocchio::computeJointTorqueRegressor(impl_->model, impl_->data, impl_->q, impl_->qd, impl_->x);
}
const char* PinocchioPeer::version() { return PINOCCHIO_VERSION; }

}  // namespace diffnea::test
