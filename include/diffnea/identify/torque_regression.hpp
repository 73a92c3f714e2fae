#pragma once
/// Streams a recording into the factors of the inverse loss: rows [Y | effects | τ] of every joint,
/// low-passed and decimated alike, then factored. One pass; memory does not grow with the
/// recording.

#include <functional>
#include <map>
#include <memory>

#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

class ConstrainedRows;
struct RowsOfState;

/// Where the regression stands: what it is linearised about.
struct RegressionPoint {
  VecX<double> linear;  ///< (p) for shape directions and for effects of the transmitted torque
  VecX<double> shape;   ///< (s)
};

/// Filtered, decimated rows of one joint, for a look at residuals: all that were factored, or whole
/// stretches of every run where these are more than is kept.
struct JointRows {
  std::vector<double> time = {};      ///< (M) [s]
  std::vector<int> run = {};          ///< (M)
  std::vector<double> velocity = {};  ///< (M) of the joint [rad/s] or [m/s]
  std::vector<double> values = {};    ///< (M, columns + 1) by rows, the last column is τ
  long width = 0;                     ///< columns + 1
  double step = 0.0;                  ///< between two rows of a stretch [s]
  std::map<int, long> factored = {};  ///< of each run, kept or not

  /// The rows as a matrix.
  Eigen::Map<const RowMatX<double>> rows() const {
    return {values.data(), static_cast<long>(time.size()), width};
  }
};

/// What becomes of the rows on their way into the factors.
struct RegressionOptions {
  /// Rows kept for residual analysis and plots [bytes in all]. All are factored; where they would
  /// be more, every second, fourth … stretch of a run is kept, and the beginning.
  long keep_bytes = 48L << 20;
  /// Dry friction at rest can have any size up to its largest, and filters blur its jump at a
  /// reversal: rows of a joint with dry friction are left out of that joint's factor where more
  /// than `rest_share` of the filter's weight lies on samples slower than `rest_speed` smoothing
  /// speeds v₀.
  double rest_speed = 10.0;
  double rest_share = 0.02;  ///< of the filter's weight; see `rest_speed`
  /// Forward loss: rows are linear about `at` in the error of the forward dynamics, q̈ − f̂ [rad/s²].
  /// Needs the torque of every joint.
  bool acceleration = false;
  /// False: rows are kept, and not factored.
  bool factored = true;
  /// Joints whose rows stand for all where constraints tie them; empty: as the first row has them.
  std::vector<int> leads;
  /// Number of the source's first recording among those that effects name (`:run=K`): held-out ones
  /// come after those of the fit.
  int first_run = 0;
  /// Weight of a row of joint j with residual r; empty: 1. Robust losses re-weigh in further
  /// passes.
  std::function<double(int joint, double residual)> weight;
};

/// Rows of a recording on their way into one triangular factor a joint, and of a base that floats
/// six more (FitLayout::num_rows): its wrench, recorded or zero.
class TorqueRegression {
 public:
  /// Columns are those of the layout, then one for each free shape parameter: ∂τ/∂(ln η) of
  /// logarithmic ones, ∂τ/∂η of others, ∂τ/∂x of fixed transforms, at `at`. Of a model with
  /// constraints, rows are those of as many coordinates as these leave motions, with the
  /// constraints' forces eliminated: of driven joints first.
  /// @throws ModelError if constraints meet free transforms or effects that read the torque that
  ///         links transmit
  TorqueRegression(const Model& model, const FitLayout& layout, const PreprocessPlan& plan,
                   const RegressionPoint& at, const RegressionOptions& options = {});

  /// Takes the next rows; segments are filtered separately.
  void add(const Preprocessed& block);

  /// One a joint.
  const std::vector<JointFactor>& factors() const { return factors_; }
  /// Unweighted where `factors` are weighted.
  const std::vector<JointRows>& kept() const { return kept_; }
  /// Forgets the rows that were kept.
  void forget();
  /// Rows of joint j that were left out because it rested.
  long rows_at_rest(int j) const { return joints_[j].at_rest; }

 private:
  struct Joint {
    std::vector<int> columns;  // of the layout, then shape directions
    Decimator decimator;
    RowMatX<double> block = {};  // [columns | τ | at rest | q̇]
    double rest_speed = 10.0;
    long emitted = 0, at_rest = 0;
    long of_run = 0;                // rows of this run so far, those at rest included
    std::vector<long> number = {};  // of every kept row within its run
  };
  void fill_row(const Preprocessed& block, const RowsOfState& states, long row);
  int coordinate(int row) const;
  bool is_fitted(const Preprocessed& block, int joint) const;
  void linearise_acceleration(const VecX<double>& q, int run);
  void flush(int joint, const RowMatX<double>& rows);
  void keep(int joint, long number, const double* row, double time);
  bool is_kept(int joint, int run, long number) const;
  void thin_out();

  void enter_run(int run);
  void add_shape_columns(const JointSample<double>& x, const VecX<double>& q, const VecX<double>& v,
                         const VecX<double>& vd);
  void add_moved_tree(int first_shape);
  void add_changed_tree(int shape);
  VecX<double> torque_of_gravity(int axis, const VecX<double>& q);
  VecX<double> inertia_columns(int joint, const VecX<double>& q);

  Model model_;
  std::shared_ptr<ConstrainedRows> constraints_;  // null: there are none
  Tree<double> tree_;                // at the point and of this run: transforms, inertias, armature
  std::vector<Tree<JetD>> moved_;    // per joint with free transform: its six directions seeded
  std::map<int, Tree<JetD>> changed_;  // per free shape that changes the tree: seeded
  std::vector<int> moved_shape_;       // index of the first of the six in the layout's shapes
  RneaWorkspace<JetD, double> jet_ws_;
  RneaWorkspace<double, double> rnea_ws_;
  MassMatrixWorkspace<double, double> mass_ws_;
  const FitLayout& layout_;
  RegressionPoint at_;
  RegressionOptions options_;
  std::vector<int> free_shapes_;
  std::vector<BoundEffect> effects_;
  int run_of_effects_ = -1;
  bool tree_of_run_ = false;                     // a payload is held in some runs only
  std::vector<std::vector<int>> effect_column_;  // per effect: column of its k-th linear parameter
  std::vector<Joint> joints_;
  std::vector<JointFactor> factors_;
  std::vector<JointRows> kept_;
  long kept_bytes_ = 0, stride_ = 1;  // one in so many stretches is kept
  int segment_ = -1, run_ = -1;
  RegressorWorkspace<double, double> ws_;
  RowMatX<double> full_;  // (rows, columns + 1) of one sample, the last column is τ
  VecX<double> links_;    // torque that the links transmit at the point, payloads included
  std::vector<double> scratch_;
  double segment_start_ = 0.0, run_start_ = 0.0, dt_ = 0.0;
};

}  // namespace diffnea
