#pragma once
/// Doubts about numbers that no robot of a description's size has: grams, millimetres,
/// placeholders.

#include <vector>

#include <diffnea/model/model.hpp>

namespace diffnea::io {

/// Doubts about masses and inertias, with the joint, the number, and what to check.
///  - a body denser than any metal: the least volume is that of a ball with its second moment
///  - a radius of gyration beyond the size of the robot: mass lies further out than any joint
///  - inertias of exactly 1, 1, 1 kg·m²
///  - a moving link without mass that carries others, away from its own joint
///  - gravity's torque beyond the effort limit of a joint in most postures
std::vector<ModelIssue> doubtful_inertias(const Model& model);

}  // namespace diffnea::io
