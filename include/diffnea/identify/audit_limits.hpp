#pragma once
/// Knowledge that an audit may have of a model.

#include <diffnea/model/model.hpp>
#include <diffnea/recording/audit.hpp>

namespace diffnea {

/// Joints, limits and the torques that the model's links need; `significance` as it is by default.
AuditLimits audit_limits(const Model& model);

}  // namespace diffnea
