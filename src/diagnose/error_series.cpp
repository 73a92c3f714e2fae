#include "diagnose/error_series.hpp"

#include <algorithm>
#include <cmath>

#include "diagnose/thresholds.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// What is left of the fitted recording over what is left of the held-out one, beyond which it is
/// no noise of both: 1.84 at most in 300 recordings that hide nothing, 2.2 in 250 others.
constexpr double kUneven = 3.0;

}  // namespace

void add_series(const VecX<double>& e0, const VecX<double>& e1, JointCase& c) {
  const Evidence& e = c.held_out->evidence();
  const std::vector<std::string> names = joint_names(c.model);
  // Rows in which a joint rests say nothing of a model, in the table as in the tests.
  const std::vector<bool> counts = c.held_out->whitener(*c.search).kept();
  for (std::size_t k = 0; k < e.joints().size(); ++k) {
    const int j = e.joints()[k];
    const long begin = static_cast<long>(k) * e.times();
    ResidualSeries s;
    s.joint = names[j];
    s.unit = unit_of_joint(c.model, j, true);
    JointGain g{s.joint, s.unit, 0.0, 0.0, 0.0, c.search->whitener().noise()[k].rms};
    double rows = 0.0;
    const bool any = std::any_of(counts.begin() + begin, counts.begin() + begin + e.times(),
                                 [](bool row) { return row; });
    for (long i = 0; i < e.times(); ++i) {
      const long row = begin + i;
      if (!c.held_rows.empty() && !c.held_rows[row]) continue;
      s.time.push_back(e.time()[i]);
      const double measured = e.torque()[row] - (e.shift().size() > 0 ? e.shift()[row] : 0.0);
      s.measured.push_back(measured);
      s.base.push_back(measured - e0[row]);
      s.extended.push_back(measured - e1[row]);
      s.q.push_back(e.q(k)(i, j));
      s.qd.push_back(e.qd(k)(i, j));
      s.qdd.push_back(e.qdd(k)(i, j));
      if (any && !counts[row]) continue;
      g.torque_rms += measured * measured;
      g.base += e0[row] * e0[row];
      g.extended += e1[row] * e1[row];
      ++rows;
    }
    for (double* v : {&g.torque_rms, &g.base, &g.extended})
      *v = std::sqrt(*v / std::max(rows, 1.0));
    c.finding.joints.push_back(g);
    c.finding.series.push_back(std::move(s));
  }
}

void note_offsets(const VecX<double>& errors, JointCase& c) {
  if (!c.test) return;
  const std::vector<std::string> names = joint_names(c.model);
  for (const HeldOutOffset& o : c.held_out->offsets(errors))
    c.finding.notes.push_back(
        names[o.joint] + ": on held-out data the torque is off by " + format_number(o.mean) +
        " ± " + format_number(kNormal95 * o.std) + " " + unit_of_joint(c.model, o.joint, true) +
        " while it moves, " + format_number(std::round(100.0 * o.share)) +
        " % of what is left: its offset changed between the recordings; give both as DATA to "
        "have it fitted (session_offset)");
}

void note_uneven(JointCase& c) {
  if (!c.test) return;
  for (std::size_t k = 0; k < c.search->whitener().noise().size(); ++k) {
    const JointGain& g = c.finding.joints[k];
    const double assumed = c.search->whitener().noise()[k].assumed,
                 seen = g.noise_floor * std::sqrt(1.0 - assumed);
    if (seen > kUneven * g.extended && g.extended > 0.0)
      c.finding.notes.push_back(
          g.joint + ": what is left of the fitted recording (" + format_number(g.noise_floor) +
          " " + g.unit + ") is " + format_number(g.noise_floor / g.extended) +
          " times what is left of the held-out one: a torque at its limit, a touch, or spikes, at "
          "some instants of it only; they pass for noise, in which smaller effects stay hidden");
  }
}

void note_floors(JointCase& c) {
  std::string joints;
  for (std::size_t k = 0; k < c.search->whitener().noise().size(); ++k) {
    const JointNoise& noise = c.search->whitener().noise()[k];
    const JointGain& g = c.finding.joints[k];
    if (noise.assumed > 0.5)
      joints += (joints.empty() ? "" : ", ") + g.joint + " " + format_number(noise.rms) + " " + g.unit;
  }
  if (!joints.empty())
    c.finding.notes.push_back("what is left shows less noise than any sensor (a simulation?): " +
                              joints + " is taken as the least, " + format_number(kLeastNoise) +
                              " of the torque");
}

}  // namespace diffnea
