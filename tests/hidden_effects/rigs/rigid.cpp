#include <cstring>
#include <stdexcept>
#include <string>

#include "plant.hpp"

namespace rigs {

using Eigen::Index;
using Eigen::VectorXd;

Rigid::Rigid(const Arm& arm) {
  const std::string document = to_mjcf(arm, false);
  mjVFS files;
  mj_defaultVFS(&files);
  const char* name = "machine.xml";
  if (mj_makeEmptyFileVFS(&files, name, static_cast<int>(document.size())) != 0)
    throw std::runtime_error("no room for the machine's document");
  std::memcpy(files.filedata[mj_findFileVFS(&files, name)], document.data(), document.size());
  char error[512] = "";
  model_.reset(mj_loadXML(name, &files, error, sizeof error));
  mj_deleteVFS(&files);
  if (!model_) throw std::runtime_error(std::string("MuJoCo: ") + error);
  data_.reset(mj_makeData(model_.get()));
  inertia_.resize(model_->nv, model_->nv);
  bias_.resize(model_->nv);
}

void Rigid::evaluate(const VectorXd& q, const VectorXd& qd) {
  const mjModel* m = model_.get();
  mjData* d = data_.get();
  std::copy_n(q.data(), m->nq, d->qpos);
  std::copy_n(qd.data(), m->nv, d->qvel);
  mj_kinematics(m, d);
  mj_comPos(m, d);
  mj_crb(m, d);
  mj_comVel(m, d);
  mj_rne(m, d, 0, bias_.data());
  mj_fullM(m, inertia_.data(), d->qM);  // symmetric: row- or column-major
}

VectorXd Rigid::torque(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd) {
  evaluate(q, qd);
  return inertia_ * qdd + bias_;
}

VectorXd Rigid::pulled(const Eigen::Vector3d& force, const Eigen::Vector3d& point) const {
  const mjModel* m = model_.get();
  const int body = m->nbody - 1;
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(data_->xmat + 9 * body);
  const Eigen::Vector3d at = Eigen::Map<const Eigen::Vector3d>(data_->xpos + 3 * body) + R * point;
  Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor> jacobian(3, m->nv);
  mj_jac(m, data_.get(), jacobian.data(), nullptr, at.data(), body);
  return jacobian.transpose() * force;
}

}  // namespace rigs
