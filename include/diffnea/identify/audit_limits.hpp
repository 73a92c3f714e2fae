#pragma once
/// Knowledge that an audit may have of a model.

#include <diffnea/model/model.hpp>
#include <diffnea/recording/audit.hpp>

namespace diffnea {

/// Joints, limits and the torques that the model's links need; `significance` as it is by default.
AuditLimits audit_limits(const Model& model);

/// Fits recordings to the joints that they have: a passive joint that is not logged, which a closed
/// loop holds, has no channel to look at. @throws as match_joints
void match_logged_joints(AuditLimits& limits, std::vector<Recording>& recordings);

}  // namespace diffnea
