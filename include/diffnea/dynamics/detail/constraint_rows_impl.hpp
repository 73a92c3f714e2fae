#pragma once

#include <diffnea/core/compiled.hpp>
#include <diffnea/dynamics/constrained_bodies.hpp>

namespace diffnea {

DIFFNEA_INLINE std::vector<bool> active_rows(const std::vector<ConstraintRow<double>>& rows,
                                             const std::vector<double>& multiplier) {
  require_size("active_rows: multiplier", static_cast<long>(multiplier.size()),
               static_cast<long>(rows.size()), "row");
  std::vector<bool> out(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i)
    out[i] = rows[i].relation == Relation::kEqual || multiplier[i] > 0.0;
  return out;
}

DIFFNEA_INLINE std::vector<bool> redundant_rows(const std::vector<FreeBody<double>>& bodies,
                                                const std::vector<ConstraintRow<double>>& rows,
                                                const std::vector<double>& multiplier) {
  constexpr double kSpan = 1e-5;  // of the row's length; the solver's 1e-10 is of its square
  const std::vector<bool> active = active_rows(rows, multiplier);
  detail::check_rows(rows, bodies.size());
  const auto size = 6 * static_cast<Eigen::Index>(bodies.size());
  std::vector<bool> out(rows.size(), false);
  MatX<double> basis(size, static_cast<Eigen::Index>(rows.size()));
  Eigen::Index rank = 0;
  for (const bool with_force : {true, false})
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (!active[i] || (multiplier[i] != 0.0) != with_force) continue;
      VecX<double> J = VecX<double>::Zero(size);
      for (std::size_t s = 0; s < rows[i].bodies.size(); ++s) {
        const int body = rows[i].bodies[s];
        if (body == kWorld) continue;
        const BodyKind kind = bodies[static_cast<std::size_t>(body)].kind;
        if (kind == BodyKind::kPrescribed) continue;
        const Wrench<double>& part = rows[i].J[s];
        if (kind == BodyKind::kRigid)  // a particle does not turn
          J.segment<3>(6 * body) += Eigen::Vector3d(part.torque.x, part.torque.y, part.torque.z);
        J.segment<3>(6 * body + 3) += Eigen::Vector3d(part.force.x, part.force.y, part.force.z);
      }
      const double length = J.norm();
      if (length > 0.0) J /= length;
      for (int twice = 0; twice < 2; ++twice)  // Gram–Schmidt, once more for rounding
        J -= basis.leftCols(rank) * (basis.leftCols(rank).transpose() * J);
      if (J.norm() > kSpan)
        basis.col(rank++) = J.normalized();
      else
        out[i] = true;
    }
  return out;
}

}  // namespace diffnea
