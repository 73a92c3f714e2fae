#pragma once
/// Candidates against what the base leaves: scores, and fits of several effects at once.
/// Everything here works on columns that are whitened and projected (projection.hpp), where effects
/// are independent of the base. Internal to diagnose/.

#include <memory>

#include "diagnose/score_table.hpp"

namespace diffnea {

class Search {
 public:
  /// @param table_bytes  most that ripples' columns may take; beyond, they are made anew whenever
  ///   they are scored, with the same results. By default 50 Hz and six joints fill it in two
  ///   minutes.
  Search(const Evidence& evidence, const std::vector<Candidate>& candidates, const BasePrior& prior,
         const std::vector<bool>& used, double table_bytes = 256e6);

  /// Noise from `period` where the motion repeats, else from what base and terms leave; whitens and
  /// projects anew.
  void refresh(double period, std::vector<Term>& terms);
  /// The columns of candidates at these joints, whose reference has moved; refresh() next.
  void recompute(const std::vector<bool>& joints) { table_.recompute(joints); }

  /// Every candidate beside `terms`, best first; of those that are not wanted nothing but their
  /// index.
  std::vector<Score> scores(const std::vector<Term>& terms, const Wanted& wanted = {}) const;
  /// Where on its candidate's grid a score is: values of its shapes, then of its choices.
  const std::vector<double>& point_of(const Score& score) const { return table_.point_of(score); }
  /// The candidate of a score as a term, where its grid has it.
  Term term_of(const Score& score) const;
  /// Columns of the term at its present parameters.
  void set_columns(Term& term) const;

  /// Linear parameters of all terms together; sets their values. @return what they remove from χ²
  double fit(std::vector<Term>& terms) const;
  double gain_of(const std::vector<Term>& terms) const;
  /// Gain of a shape of one of the terms, if all were linear in it.
  double gain_by_shape(const std::vector<Term>& terms, std::size_t which, int shape) const;

  NormalEquations normal(const std::vector<const Term*>& terms) const;
  NormalEquations normal(const std::vector<Term>& terms) const;
  /// BIC of a gain, lower is better, relative to the base alone.
  double bic(double gain, const std::vector<Term>& terms) const;
  double bic(const std::vector<Term>& terms) const { return bic(gain_of(terms), terms); }
  int num_parameters(const std::vector<Term>& terms) const;

  /// How much of a term's projected torque another one can take over together with those that are
  /// there, 0 … 1.
  double replaced_share(const Term& term, const Term& by, const std::vector<Term>& beside) const;

  /// Share that the base leaves of what `more` can do and `less` cannot, 0 … 1.
  double visible_beyond(const Term& more, const Term& less) const;

  /// Cost of a fit, −2 ln of its likelihood but for a constant: n ln χ², the noise as large as
  /// what is left and what is assumed; where repeats have told the noise and no more is left, χ².
  /// @param share  of the rows that it is of
  double cost(double chi2, double share = 1.0) const;
  /// Penalty of the best of a candidate's starts for being the best of many (Bonferroni).
  double looked_elsewhere(int candidate) const;

  const Evidence& evidence() const { return evidence_; }
  const std::vector<Candidate>& candidates() const { return candidates_; }
  const Candidate& candidate(const Term& term) const { return candidates_[term.candidate]; }
  const Projection& projection() const { return *projection_; }
  /// Counts projections: what was made with one holds until the next.
  long revision() const { return revision_; }
  const Whitener& whitener() const { return *whitener_; }
  double residual_sum() const { return projection_->residual().squaredNorm(); }
  long rows() const { return projection_->rows(); }
  double period() const { return period_; }  ///< [s]; 0: the motion does not repeat
  bool noise_is_repeatable() const { return repeatable_; }
  /// Joints (of evidence().joints()) whose noise is what the base leaves of too few rows: what the
  /// model lacks there is taken for noise.
  const std::vector<long>& blind() const { return blind_; }
  /// The residual of torque at the base that goes with the terms, (rows()).
  VecX<double> residual(const std::vector<Term>& terms) const;

  /// By how many samples the torque acts later than its rows say, as the base beside the terms has
  /// it; 0 where it lies beyond a sample, and is left to the causes.
  double late(const std::vector<Term>& terms) const;
  /// By how much the term has torques act later than their rows say [s].
  static double shift(const Term& term);
  /// Tells whether all that shifts a joint's torque, base and terms, comes to no more than a drive
  /// that samples and holds its torques may have. Beside fewer terms than the projection was made
  /// with, it may be more.
  bool samples_and_holds(int joint, const std::vector<Term>& terms) const;
  /// The same of some joint that is driven: that of the others is a cause's.
  bool samples_and_holds(const std::vector<Term>& terms) const;

  /// What is left beside base and terms at their values, whitened.
  VecX<double> left_by(const std::vector<Term>& terms) const;

  /// RMS of the term's torque over that of the measured torque, at the joints it acts on.
  double torque_share(const Term& term) const;

 private:
  const Evidence& evidence_;
  const std::vector<Candidate>& candidates_;
  /// The torque's instant moves with the base where the recording has it, and what terms shift
  /// beside, within a sample at some joint. Where it lies beyond, something is late, and the base
  /// does not move it: it would take a clock's shift over, and leave its cause nothing to explain.
  const BasePrior& prior() const { return instant_ ? moving_ : held_; }
  void set_projection(std::vector<Term>& terms);

  BasePrior moving_, held_;  ///< with and without the torque's instant
  bool instant_ = true;
  std::vector<bool> used_;
  ScoreTable table_;
  std::unique_ptr<Whitener> whitener_;
  std::unique_ptr<Projection> projection_;
  long revision_ = 0;
  double period_ = 0.0;  ///< [s]
  bool repeatable_ = false;
  std::vector<long> blind_;
};

}  // namespace diffnea
