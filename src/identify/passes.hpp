#pragma once
/// One pass over a source of recordings, shared by the losses. Internal to identify/.

#include <diffnea/identify/identify.hpp>

namespace diffnea {

/// What a pass saw besides the rows it handed on.
struct Pass {
  long rows = 0;
  int runs = 0;  // recordings
  bool interrupted = false;
  VecX<double> lowest, highest;  // of q, filtered
  std::vector<std::string> notes;
};

/// Preprocesses the source block by block and hands the rows on; stops when options.progress says
/// so.
Pass for_each_block(const RecordingSource& source, const PreprocessPlan& plan,
                    const std::string& stage, int iteration, const IdentifyOptions& options,
                    const std::function<void(const Preprocessed&)>& use);

/// A held-out error on data of the fit would be a lie, however the copy is called.
/// @throws DataError if a recording of the one holds the rows of one of the other, and no more
void refuse_same_recording(const RecordingSource& train, const RecordingSource& test);

/// Four significant digits.
std::string format_number(double x);

/// The layout of a fit to these recordings, with the bodies that they say the robot held.
/// @param test   held-out recordings, numbered after those of the fit; may be null
/// @param notes  added to
/// @throws DataError, ModelError if an effect is asked for in a recording that does not exist, or
/// has
///         something to fit and acts in no recording of the fit
FitLayout layout_for(const Model& model, const RecordingSource& source, const RecordingSource* test,
                     const FitChoice& choice, std::vector<std::string>& notes);

/// Number of parameters that a fit moves, shapes included.
double count_free(const FitLayout& layout);

/// Whether some column hangs on the torque that the links transmit, and with it on their
/// parameters, by a law that is not linear in it (gains are).
bool reads_links(const FitLayout& layout);

/// Estimates in the order of the layout: linear parameters, then shapes.
/// @param shape_std  of the shapes: 0 where held, NaN where not identifiable; empty: none was
/// fitted
std::vector<ParameterEstimate> parameter_estimates(const FitLayout& layout, const VecX<double>& x,
                                                   const VecX<double>& shape,
                                                   const VecX<double>& std,
                                                   const std::vector<bool>& identifiable,
                                                   const std::vector<int>& at_bound,
                                                   const VecX<double>& shape_std = {});

/// The Gaussian that `data` of this information leave of the free linear parameters.
Posterior posterior_of(const FitLayout& layout, const VecX<double>& x,
                       const MatX<double>& information, const RecordingSource& data);
/// What tells each recording of a source from others (RunDescription::motion).
std::vector<std::string> fingerprints(const RecordingSource& source);

/// "N*m" or "N" for torques of joint j, "rad" or "m" for positions.
std::string unit_of_joint(const Model& model, int j, bool of_torque);
/// Joint j's line of the table of errors, without a number yet: all NaN.
JointError blank_error(const Model& model, int j, bool of_torque);

/// The losses.
IdentifyResult identify_by_torque(const Model& model, const RecordingSource& train,
                                  const RecordingSource* test, const IdentifyOptions& options);
IdentifyResult identify_by_motion(const Model& model, const RecordingSource& train,
                                  const RecordingSource* test, const IdentifyOptions& options);
/// The motion loss of all joints at once, whatever limbs they are of.
IdentifyResult fit_motion(const Model& model, const RecordingSource& train,
                          const RecordingSource* test, const IdentifyOptions& options);

}  // namespace diffnea
