#pragma once
/// Torque errors before and after, joint by joint over the held-out rows. Internal to diagnose/.

#include "diagnose/joint_case.hpp"

namespace diffnea {

/// Series and their root mean squares, into the finding.
/// @param e0, e1  (held-out rows) errors of the base and of the extended model
void add_series(const VecX<double>& e0, const VecX<double>& e1, JointCase& c);

/// What changed between the recordings is no cause of the fitted one: a note.
void note_offsets(const VecX<double>& errors, JointCase& c);
/// What the fitted recording alone holds, so much that nothing else would show: a note.
void note_uneven(JointCase& c);
/// Joints whose noise is assumed, for they show none: a note.
void note_floors(JointCase& c);

}  // namespace diffnea
