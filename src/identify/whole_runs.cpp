#include "identify/whole_runs.hpp"

namespace diffnea {
namespace {

/// Rows of one recording, the first of its blocks and what follows.
class Joined {
 public:
  bool goes_on(const Recording& r) const {
    return started_ && first_.run == r.run && first_.source == r.source;
  }
  void begin(const Recording& r) {
    first_ = r;
    blocks_.clear();
    started_ = true;
  }
  void add(const Recording& r) { blocks_.push_back(r); }

  /// @return null if there is none
  const Recording* finish() {
    if (!started_) return nullptr;
    started_ = false;
    if (blocks_.empty()) return &first_;
    long rows = first_.rows();
    for (const Recording& b : blocks_) rows += b.rows();
    const auto stack = [&](const auto& member) {
      auto& to = member(first_);
      if (to.size() == 0) return;
      long at = to.rows();
      to.conservativeResize(rows, to.cols());
      for (Recording& b : blocks_) {
        to.middleRows(at, b.rows()) = member(b);
        at += b.rows();
      }
    };
    stack([](Recording& r) -> VecX<double>& { return r.time; });
    for (const auto member : kSeries)
      stack([member](Recording& r) -> RowMatX<double>& { return r.*member; });
    for (std::size_t k = 0; k < first_.extra.size(); ++k)
      stack([k](Recording& r) -> VecX<double>& { return r.extra[k].values; });
    blocks_.clear();
    return &first_;
  }

 private:
  bool started_ = false;
  Recording first_;
  std::vector<Recording> blocks_;
};

}  // namespace

void for_each_run(const RecordingSource& source,
                  const std::function<bool(const Recording&)>& wanted,
                  const std::function<void(const Recording&)>& use) {
  Joined run;
  const auto finish = [&] {
    if (const Recording* whole = run.finish()) use(*whole);
  };
  source.for_each([&](const Recording& r) {
    if (!wanted(r)) return true;
    if (run.goes_on(r)) {
      run.add(r);
    } else {
      finish();
      run.begin(r);
    }
    return true;
  });
  finish();
}

}  // namespace diffnea
