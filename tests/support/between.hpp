#pragma once
/// Part of a recording.

#include <diffnea/recording/recording.hpp>

namespace diffnea::test {

/// The rows from one time on, before another; extra channels are left out.
inline Recording between(Recording r, double from, double to) {
  long first = 0, last = 0;
  while (first < r.rows() && r.time[first] < from) ++first;
  for (last = first; last < r.rows() && r.time[last] < to;) ++last;
  r.time = VecX<double>(r.time.segment(first, last - first));
  for (RowMatX<double>* m : {&r.q, &r.qd, &r.qdd, &r.qcmd, &r.tau})
    if (m->rows() > 0) *m = RowMatX<double>(m->middleRows(first, last - first));
  r.extra.clear();
  return r;
}

}  // namespace diffnea::test
