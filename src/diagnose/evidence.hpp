#pragma once
/// Recordings as a diagnosis sees them: rows of measured torque, of the base model's columns, and
/// of the columns of any effect, on demand, each as it shows beside the noise of its joint's
/// signals (torque_filter.hpp), on the scale of a torque that is constant. Internal to diagnose/.
///
/// Rows of the joints whose torque is known are stacked: row m of the k-th such joint is row
/// k·times() + m. All matrices here are (rows(), columns). Where constraints close loops, these are
/// the joints that lead, and their rows hold what is asked of them by all (driven_rows.hpp).

#include <functional>
#include <map>

#include <diffnea/effects/series.hpp>
#include <diffnea/identify/torque_regression.hpp>

#include "diagnose/candidates.hpp"
#include "diagnose/driven_rows.hpp"
#include "diagnose/sticking.hpp"
#include "diagnose/stretches.hpp"
#include "diagnose/torque_filter.hpp"
#include "diagnose/turns.hpp"
#include "identify/passes.hpp"

namespace diffnea {

/// Of the autoregression that whitens rows: what a row needs before it.
inline constexpr int kNoiseOrder = 8;

/// Where rows are straight lines in what is fitted.
struct Linearisation {
  /// How heavy the joints are: by the file, and where that is far off, by a fit.
  Model links;
  /// Widths of the base's dry friction beside causes, by the layout's shapes; empty: as the base
  /// alone has them.
  std::vector<double> widths = {};
  /// By how much dry friction turns before the velocity does, by joint [s]; empty: 0.
  VecX<double> early = {};
};

class Evidence {
 public:
  /// @param about      its links are those about which the filters are linearised
  /// @param layout     of the base model
  /// @param period     of the motion [s]; 0: not periodic
  /// @param first_run  number of the source's first recording among all that the layout knows
  /// @param fitted     of a held-out recording, that of the fitted one: turns of the same joints
  /// are
  ///   left out, for a base that has not seen them says nothing of them
  /// @param base_joints  how many degrees of freedom lead that are a floating base's (UnfoldedBase)
  /// @throws DataError if no row is left, or a joint's torque is known in some of the recordings
  ///   alone
  Evidence(const Model& model, const Linearisation& about, const FitLayout& layout,
           const RecordingSource& source, const PreprocessPlan& plan, double period,
           const IdentifyOptions& options, int first_run = 0, const Evidence* fitted = nullptr,
           int base_joints = 0);

  long rows() const { return torque_.size(); }
  /// Rows of one joint; the same instants for all.
  long times() const { return std::ssize(time_); }
  /// Degrees of freedom that have rows, ascending: those whose torque is known.
  const std::vector<int>& joints() const { return joints_; }
  /// Index among them; −1: the joint has no rows.
  long index_of(int joint) const;
  /// Torques that reach their rows.
  const DrivenRows& driven_rows() const { return driven_rows_; }
  /// Indices of joints() that torques of some degrees of freedom reach.
  std::vector<long> reached(const std::vector<int>& by) const;
  int num_dofs() const { return num_dofs_; }

  const VecX<double>& torque() const { return torque_; }
  /// RMS torque of the k-th of joints(); of a passive one, what its links take, by those that the
  /// rows are linear about.
  double size(long k) const { return size_[k]; }
  /// RMS of rows of the k-th of joints(). @param rows  (rows())  @param counts  empty: all
  double rms(long k, const VecX<double>& rows, const std::vector<bool>& counts) const;
  /// The size, but of a passive one, at which torques cancel, the root of their sum of squares: the
  /// base's columns one by one.
  double scale(long k) const { return scale_[k]; }
  /// Rows of base() of the k-th of joints(); of a passive one as those of M_jj(x₀)/M_jj(x) times
  /// what is left, linear about x₀ (JointFactor::inertia).
  MatX<double> without_scale(long k, const Eigen::Ref<const MatX<double>>& rows,
                             const VecX<double>& x0) const;
  /// Chosen columns of base(), or of seen_base(), so.
  MatX<double> without_scale(const MatX<double>& base, const VecX<double>& x0,
                             const std::vector<int>& columns) const;
  bool has_passive_beside_torques() const;
  /// Whether nothing drives the k-th of joints(): its torque is 0, or a ball's pull.
  bool passive(long k) const { return passive_[k]; }
  /// Tells whether a degree of freedom has rows that nothing drives, or moves by constraints alone.
  bool is_passive(int joint) const;
  /// Tells whether a row of the k-th of joints() still hangs on how its stretch begins.
  bool begins(long instant, long k) const;
  /// Tells whether some torque is not 0.
  bool driven() const {
    return std::ranges::any_of(series_, [&](const JointSeries& s) {
      return std::ranges::any_of(joints_, [&](int j) { return !s.logged.col(j).isZero(0.0); });
    });
  }
  /// Columns of the layout's linear parameters, then ∂τ/∂ln v₀ of the base's smoothed friction,
  /// then turn_columns() of each: how it turns is not known; the last, by how many samples the
  /// torque is logged late.
  const MatX<double>& base() const { return base_; }
  /// The same of the motion that effects see (series()): what of a candidate's columns the base
  /// takes over.
  const MatX<double>& seen_base() const { return apart_ ? seen_base_ : base_; }
  /// Those of base()'s columns that are dry friction's.
  const std::vector<int>& dry_columns() const { return dry_columns_; }

  /// A torque is sampled, computed and held within a sample before or after the positions beside
  /// it, in a way that no log tells: how late it may be without a delay [samples], from a mean over
  /// the sample before the position to one that is held for a sample and computed for half of one.
  /// One that is logged less often than the rest may be the last one known, or held for so long.
  double earliest_instant() const { return earliest_instant_; }
  double latest_instant() const { return latest_instant_; }

  // Of each instant, (times()).
  const std::vector<double>& time() const { return time_; }
  /// Instants with the same number follow one another at equal steps.
  const std::vector<int>& stretch() const { return stretch_; }
  int first_run() const { return first_run_; }
  /// Numbers of the source's recordings.
  const std::vector<int>& runs() const { return runs_; }
  /// Whether the k-th of joints() hardly moves, or sticks: rows that say nothing of a model.
  bool rests(long instant, long k) const { return rests_(instant, k); }
  /// Tells whether something drives it and it stands still (sticking.hpp).
  bool sticks(long instant, long k) const { return sticks_(instant, k); }
  /// Degrees of freedom that stick wherever they turn back: their turns are left out.
  const std::vector<int>& sticking() const { return sticking_; }
  /// Degrees of freedom that stand still all along: not among joints(), as no motion tells what
  /// holds them.
  const std::vector<int>& resting() const { return resting_; }
  /// Frequency up to which the path or the rows of the k-th of joints() hold something [Hz].
  double cut_off(long k) const { return cut_off_[k]; }
  /// Noise that the signals give a row of the k-th of joints() [N·m] or [N].
  double signal_noise(long k) const { return unit_[k]; }
  /// How often the k-th of joints() turns back [1/s].
  double turns_per_second(long k) const { return turns_per_second_[k]; }
  /// Positions, velocities, accelerations that go with rows of the k-th of joints(), (times(),
  /// num_dofs()): weighed means of the past, as the rows are.
  ///@{
  auto q(long k) const { return states_[k].leftCols(num_dofs_); }
  auto qd(long k) const { return states_[k].middleCols(num_dofs_, num_dofs_); }
  auto qdd(long k) const { return states_[k].middleCols(2 * num_dofs_, num_dofs_); }
  ///@}
  /// Step between instants of one stretch [s].
  double step() const { return step_; }
  /// Tells whether the motion is the same in every period.
  bool repeats() const { return repeats_; }
  /// Tells whether effects see another motion than the rows.
  bool apart() const { return apart_; }
  /// Tells whether that is of other samples, and its noise another.
  bool halves() const { return halves_; }
  /// Samples at the recording's rate, as effects see them. Where the log is fast enough, rows are
  /// those of the path through the even samples, and effects see that through the odd ones: its
  /// noise is neither that of the torque, which a controller has made of its positions' noise, nor
  /// that of the base's columns. Columns of high derivatives would find both. Where it is not fast
  /// enough, or both halves would err alike, effects see a smoother path (joints_alike()).
  const std::vector<JointSeries>& series() const { return series_; }

  /// Factors of the base columns, unwhitened, all rows.
  const std::vector<JointFactor>& factors() const { return factors_; }

  /// The model that effects of torque refer to: what the links transmit, what the drives give.
  /// @return the change of each joint's torque, (num_dofs()) [share of the RMS]
  VecX<double> set_reference(const Model& fitted);

  /// The base's columns of its inertias become those under `more` gravity, for base parameters near
  /// `x`: what only a tilted base shows of the links may then move. (Y(g+δ)π + C(π̂)δ̃ in the place
  /// of Y(g)π + C(π̂)δ: torque() shifts by (Y(g+δ) − Y(g))π̂.)
  void set_tilt(const Vec3<double>& more, const VecX<double>& x);
  /// That shift, (rows()); empty without a tilt.
  const VecX<double>& shift() const { return shift_; }

  /// ∂τ/∂p of chosen parameters of an effect, (rows(), which.size()).
  /// @param torque  if not null: the effect's own torque at its parameters, too, (rows())
  MatX<double> columns(const TriedEffect& effect, const std::vector<int>& which,
                       VecX<double>* torque = nullptr) const;
  /// sin nq and cos nq of a joint for `count` n from `first` on, `step` apart, as rows that its
  /// torque reaches: hands each k < count and its (times() · reached(), 2) matrix to `visit`, in
  /// order. By the sum of angles: a tenth of the time of as many columns().
  void ripples(int joint, double first, double step, int count,
               const std::function<void(int, MatX<double>)>& visit) const;
  /// Any torques of the k-th of joints() alone at the recording's rate, a column each, as rows,
  /// (times(), columns).
  MatX<double> rows_of(long k,
                       const std::function<RowMatX<double>(const JointSeries&)>& columns) const;
  /// Second and third derivatives of the torque that the base predicts for the k-th of joints(),
  /// which a motor behind a spring shows, (times(), 2).
  MatX<double> curvature(long k) const;
  /// Tells whether the model that effects refer to has friction at a joint.
  bool has_friction(int joint) const;
  /// The effect's own torque at its parameters, (rows()).
  VecX<double> torque_of(const TriedEffect& effect) const;
  /// Computes an own candidate's columns, once and for all: they depend on the motion alone.
  /// @throws DataError naming the candidate if they are not (N, parameters) finite numbers
  void evaluate(const TriedEffect& effect);

 private:
  // Steps of the constructor, in this order.
  /// The stretches of the recordings; of motions that repeat, once they have settled.
  void take_series(Stretches& collector, double period);
  /// Two paths of each, one for the rows and one for effects; where nothing is driven, no motor is
  /// hidden, and rows that remember the whole run want every sample.
  void take_halves(Stretches& collector, const PreprocessPlan& plan);
  /// Joints whose torque is known throughout; of closed chains those that lead.
  void take_joints(const Model& model, const Stretches& collector, const Evidence* fitted);
  /// Equations of the joints along the next stretch. @param own  its path, of the rows
  std::vector<JointEquation> equations_along(const Tree<double>& tree, const JointSeries& own,
                                             const SignalNoise& noise, const PreprocessPlan& plan);
  /// A filter for every joint and stretch.
  void take_filters(const Model& links, const PreprocessPlan& plan, const Stretches& collector);
  /// Rows of the base's columns at one motion. @param torque  if not null: of the torque, too
  MatX<double> regress(const Model& model, const FitLayout& layout, const PreprocessPlan& plan,
                       const Stretches& collector, const std::vector<JointSeries>& series,
                       VecX<double>* torque);
  /// Torques, base columns and their instants.
  void take_rows(const Model& model, const Model& links, const FitLayout& layout,
                 const PreprocessPlan& plan, const Stretches& collector);
  /// Where driven joints stand still; leaves out those that do all along.
  /// @param positions  as logged, a matrix for each stretch
  void take_standstills(const FitLayout& layout, const PreprocessPlan& plan,
                        const Stretches& collector, const std::vector<RowMatX<double>>& positions,
                        const Evidence* fitted);
  StuckRows stuck_at(int joint, Turns what, const PreprocessPlan& plan,
                     const std::vector<RowMatX<double>>& positions) const;
  /// States of these instants; where joints rest, stick and turn.
  void take_motion(const PreprocessPlan& plan, const std::vector<RowMatX<double>>& positions,
                   const Evidence* fitted);
  void take_states();
  /// Rows whose events the path does not follow.
  void take_events(const PreprocessPlan& plan, const std::vector<RowMatX<double>>& positions);
  /// Rows of the k-th of joints() that whitening has enough rows before.
  long rows_between(long k) const;

  /// The motion that dry friction at these joints goes by: it turns before, or after, them.
  JointSeries turned(const BoundEffect& friction, const JointSeries& s) const;
  /// Writes the columns of the layout's dry friction that turns at other instants than the path.
  void retime(const Model& model, const FitLayout& layout, const std::vector<JointSeries>& series,
              MatX<double>& base) const;
  /// turn_columns() of every friction of the layout, (rows(), kTurnColumns · frictions).
  MatX<double> turns(const FitLayout& layout) const;
  /// Writes the base's last column, by the present reference.
  void set_instant();
  /// Rows of the k-th of joints(), of torques at the recording's rate, a matrix for each stretch.
  MatX<double> rows_of(long k, const std::vector<RowMatX<double>>& stretches) const;
  /// The same of torques that act at some joints. @param torques  of a stretch and a joint, (N, C)
  MatX<double> driven(long k, const std::vector<int>& joints,
                      const std::function<RowMatX<double>(std::size_t, int)>& torques) const;
  /// @param columns  of each stretch, each (N, num_dofs())
  MatX<double> driven(long k, const std::vector<int>& joints,
                      const std::vector<std::vector<RowMatX<double>>>& columns) const;
  /// Positions that encoders show beside the path of a stretch, of the k-th of joints(), (N).
  VecX<double> shown(std::size_t stretch, std::size_t k, const RowMatX<double>& positions,
                     const RowMatX<double>& path) const;
  /// The same of means, not of sums.
  MatX<double> means_of(long k, const std::vector<RowMatX<double>>& stretches) const;
  std::vector<int> all_joints() const;
  const ExtendedTree& reference(const JointSeries& s) const { return references_.at(s.run); }

  DrivenRows driven_rows_;
  std::vector<bool> has_torque_;  ///< by degree of freedom
  /// By stretch and joint of a closed chain: LoopEquation::shown.
  std::vector<std::vector<RowMatX<double>>> shown_;
  int num_dofs_ = 0, first_run_ = 0, base_joints_ = 0;
  double earliest_instant_ = -0.5, latest_instant_ = 1.0;
  bool has_instant_ = false;
  std::vector<double> turns_per_second_, cut_off_;
  bool repeats_ = false, apart_ = false, halves_ = false;
  std::vector<int> joints_, dry_columns_, sticking_, resting_;
  VecX<double> speed_, acceleration_;      ///< RMS, (num_dofs())
  std::map<int, StuckRows> stuck_;         ///< by joint
  std::vector<std::vector<bool>> events_;  ///< rows of each stretch
  std::vector<JointSeries> series_;
  std::vector<int> runs_;
  std::vector<std::vector<TorqueFilter>> filters_;  ///< by stretch and joint
  VecX<double> unit_;                               ///< a constant torque of 1 over its row
  std::vector<MatX<double>> constant_;  ///< by joint: rows of a constant torque of 1, one column
  int every_ = 1;                       ///< samples of a row
  VecX<double> early_;                  ///< Linearisation::early, (num_dofs())
  std::vector<JointFactor> factors_;
  std::map<std::pair<std::string, std::string>, MatX<double>> own_;  ///< by name and place
  std::map<int, ExtendedTree> references_;  ///< by run: a body may be held in some of them
  std::vector<double> time_;
  std::vector<int> stretch_;
  double step_ = 0.0;
  VecX<double> torque_, shift_;
  MatX<double> tilted_;  ///< what set_tilt() has added to the base's first columns
  std::vector<double> size_, scale_;
  std::vector<bool> passive_;  ///< as recorded: set_tilt() shifts torque_
  MatX<double> base_, seen_base_;
  std::vector<MatX<double>> states_;  ///< by joint: [q | q̇ | q̈]
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> rests_,
      sticks_;  ///< (times(), joints().size())
};

}  // namespace diffnea
