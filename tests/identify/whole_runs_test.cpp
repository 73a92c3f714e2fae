/// Blocks of a stream, joined, are the recording that they were cut from, whatever its channels.

#include "identify/whole_runs.hpp"

#include <catch2/catch_test_macros.hpp>

namespace whole_runs_test {

using namespace diffnea;

namespace {

/// Recordings as a stream gives them: `size` rows at a time.
class Blocks : public RecordingSource {
 public:
  Blocks(std::vector<Recording> whole, long size) : whole_(std::move(whole)), size_(size) {}
  void for_each(const std::function<bool(const Recording&)>& use) const override {
    for (const Recording& r : whole_)
      for (long from = 0; from < r.rows(); from += size_) {
        const long m = std::min(size_, r.rows() - from);
        Recording block = r;
        block.time = VecX<double>(r.time.segment(from, m));
        for (auto member : {&Recording::q, &Recording::qcmd, &Recording::tau, &Recording::ball})
          if ((r.*member).size() > 0)
            block.*member = RowMatX<double>((r.*member).middleRows(from, m));
        for (std::size_t k = 0; k < r.extra.size(); ++k)
          block.extra[k].values = VecX<double>(r.extra[k].values.segment(from, m));
        if (!use(block)) return;
      }
  }
  std::vector<Recording> sample() const override { return {whole_.front()}; }
  std::vector<int> runs() const override { return {0, 1}; }
  std::vector<RunDescription> describe_runs() const override { return {}; }
  bool holds_payload() const override { return false; }
  const ReadReport& report() const override { return report_; }
  const std::vector<ChannelWarning>& warnings() const override { return warnings_; }

 private:
  std::vector<Recording> whole_;
  long size_;
  ReadReport report_;
  std::vector<ChannelWarning> warnings_;
};

Recording recording(int run, long rows, bool ball) {
  Recording r;
  r.source = "run " + std::to_string(run);
  r.run = run;
  r.joint_names = {"a", "b"};
  r.has_tau = {true, true};
  r.time = VecX<double>::LinSpaced(rows, 0.0, 1.0);
  r.q = RowMatX<double>::Random(rows, 2);
  r.qcmd = RowMatX<double>::Random(rows, 2);
  r.tau = RowMatX<double>::Random(rows, 2);
  if (ball) r.ball = RowMatX<double>::Random(rows, 3);
  r.extra = {{"current", VecX<double>::Random(rows)}};
  return r;
}

}  // namespace

TEST_CASE("whole runs: all channels of the blocks are joined, run by run", "[identify]") {
  const std::vector<Recording> all{recording(0, 100, true), recording(1, 45, false)};
  const Blocks source(all, 30);
  std::vector<Recording> found;
  for_each_run(
      source, [](const Recording&) { return true; },
      [&](const Recording& r) { found.push_back(r); });
  REQUIRE(found.size() == 2);
  for (std::size_t k = 0; k < 2; ++k) {
    CHECK(found[k].run == all[k].run);
    CHECK(found[k].time == all[k].time);
    for (auto member :
         {&Recording::q, &Recording::qd, &Recording::qcmd, &Recording::tau, &Recording::ball}) {
      REQUIRE((found[k].*member).rows() == (all[k].*member).rows());
      CHECK(found[k].*member == all[k].*member);
    }
    CHECK(found[k].extra[0].values == all[k].extra[0].values);
  }
  std::vector<int> shown;
  for_each_run(
      source, [](const Recording& r) { return r.ball.size() > 0; },
      [&](const Recording& r) { shown.push_back(r.run); });
  CHECK(shown == std::vector<int>{0});
}

}  // namespace whole_runs_test
