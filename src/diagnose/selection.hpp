#pragma once
/// Which effects together: forward by the best score that also helps on held-out data, backward by
/// elimination, then what else could stand in each one's place. Internal to diagnose/.

#include <algorithm>
#include <map>

#include <diffnea/diagnose/cause.hpp>
#include <diffnea/diagnose/tried.hpp>

#include "diagnose/held_out.hpp"

namespace diffnea {

struct SelectionOptions {
  double accept = 10.0;  ///< ΔBIC
  int max_terms = 8;
  double period = 0.0;  ///< [s]
  std::uint64_t seed = 0;
  /// Refits the model that columns refer to beside the terms; joints whose torques that moved.
  std::function<std::vector<bool>(const std::vector<Term>&)> rebase;
  std::function<bool(const FitProgress&)> progress;  ///< returns false: stop with what there is
};

class Selection {
 public:
  Selection(Search& search, const HeldOut& held_out, const SelectionOptions& options)
      : search_(search), candidates_(search.candidates()), held_out_(held_out), options_(options) {}

  std::vector<Term> run();
  /// Goes on without one of the terms, which does not stand again.
  void resume(std::vector<Term>& terms, std::size_t without, const char* why);
  /// Evidence, rivals and gain of each accepted term.
  std::vector<Cause> causes(const std::vector<Term>& terms) const;
  const std::vector<Refusal>& refused() const { return refused_; }

 private:
  struct Offer {
    Term term;
    double delta_bic;
  };
  /// A score's candidate refined beside `terms`: from its grid, or from where it was before, if
  /// that is better.
  Term offered(const Score& score, const std::vector<Term>& terms) const;
  /// The best candidates beside `terms`, shapes refined, best first.
  /// @param wanted  of which; nothing: of all
  std::vector<Offer> offers(const std::vector<Term>& terms, int how_many,
                            const Wanted& wanted = {}) const;
  /// The same of all candidates, remembered until the base moves.
  const std::vector<Offer>& rivals(const std::vector<Term>& terms) const;
  /// Grows, simplifies and drops until nothing falls any more: what is left when one falls stood
  /// beside it, and may not be what stands alone.
  void go_on(std::vector<Term>& terms);
  /// Adds causes while one is found that helps, and improves what is there.
  void grow(std::vector<Term>& terms);
  bool add_one(std::vector<Term>& terms);
  /// Moves one for another until none is better, with the model, columns and noise that go with
  /// them.
  void settle(std::vector<Term>& terms);
  /// Model, columns and noise that go with the terms.
  void renew(std::vector<Term>& terms);
  /// Candidates that have not fallen, of those that are wanted.
  Wanted standing(const Wanted& also = {}) const;
  bool eliminate(std::vector<Term>& terms) const;
  bool is_impossible(int candidate) const {
    return std::ranges::find(impossible_, candidate) != impossible_.end();
  }
  /// Drops what has come to a size that no robot has beside the others, for good.
  bool drop_impossible(std::vector<Term>& terms);
  bool exchange(std::vector<Term>& terms) const;
  /// How sharply a dry friction turns, where that makes a clear difference.
  bool sharpen(std::vector<Term>& terms) const;
  /// Effects of one parameter at the joints of a term in its place, if they do better: as well,
  /// where it is compound; by ΔBIC > accept where it has one parameter itself.
  bool split(std::vector<Term>& terms) const;
  /// One of the terms for another, or for two of one parameter at its joints, where all rows have
  /// more evidence for that: BIC of the fitted ones, and the likelihood of those held out, as
  /// either predicts them (prequential, Dawid 1984). ΔBIC > accept; what goes does not stand again.
  /// Asked where the cause would be unknown else.
  bool judge(std::vector<Term>& terms);
  /// Effects of one parameter at joints of a term, other than it.
  Wanted parts_of(const Term& whole) const;
  /// The best two of them beside the rest, with the rest.
  std::vector<std::vector<Term>> pairs_for(const Term& whole, const std::vector<Term>& rest) const;
  /// One effect in the place of two at its joints, if it is no worse: one cause is simpler.
  bool merge(std::vector<Term>& terms) const;
  /// A simpler effect in a term's place, if the term can be that effect and is not clearly better,
  /// or has no size that the recording tells.
  bool simplify(std::vector<Term>& terms) const;
  /// Either, if all that is put there stays once the base has been fitted beside it.
  bool put_simpler(std::vector<Term>& terms);
  /// Drops what does not help on data that no fit has seen, or may be nothing, the least first.
  /// @return whether another may stand where one stood
  bool drop_needless(std::vector<Term>& terms);
  /// Drops the cause that, together with what may stand for it, is chosen on the fewest halves of
  /// the recording, where that is not most. @return whether there is one
  bool drop_unstable(std::vector<Term>& terms);
  /// What `with` is worth on held-out data beside `without`, each of them fitted.
  HeldOutChange change(std::vector<Term> without, std::vector<Term> with) const;
  /// Tells whether that is certain.
  bool helps(const std::vector<Term>& without, const std::vector<Term>& with) const;
  /// The same of the last of `with`, beside a base that is fitted with it. If not, `terms` are as
  /// they were.
  bool helps_anew(std::vector<Term>& terms, std::vector<Term>& with);
  /// The same of a tilt beside the rest: without it the base's columns are others.
  bool tilt_helps(const std::vector<Term>& rest, std::vector<Term>& terms);
  void note_refusal(const Candidate& c, const char* why, double delta_bic);
  void add_rivals(const std::vector<Term>& terms, std::size_t which, Cause& cause) const;

  Search& search_;
  const std::vector<Candidate>& candidates_;
  const HeldOut& held_out_;
  SelectionOptions options_;
  std::vector<Refusal> refused_;
  std::vector<int> refused_candidates_;
  std::vector<int> impossible_;   ///< candidates
  std::vector<int> fallen_;  ///< candidates that others stand without; they may still be rivals
  mutable std::map<int, Term> refined_;  ///< shapes and parameters, where they were last
  /// By candidates and parameters of the terms beside them.
  mutable std::map<std::vector<double>, std::vector<Offer>> rivals_;
  std::map<int, double> chosen_;  ///< share of halves that choose a candidate; empty: not asked
};

}  // namespace diffnea
