/// Study: a WAM that the model does not know exactly, recorded in MuJoCo, identified from 40 s.
/// Over many seeds, does the residual reach the noise floor, and do the 95 % intervals of the base
/// parameters hold the truth?
///
///     identify_coverage [SEEDS=50] [FIRST=0] [FILTER_HZ=0]

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <support/wam_study.hpp>
#include <vector>

int main(int argc, char** argv) {
  using namespace diffnea;
  const unsigned seeds = argc > 1 ? static_cast<unsigned>(std::atoi(argv[1])) : 50;
  const unsigned first = argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 0;
  IdentifyOptions options;
  if (argc > 3) options.preprocess.filter_hz = std::atof(argv[3]);
  std::vector<double> ratios;
  test::Coverage all;
  std::printf("seed  inside/of   held-out error over noise floor, by joint\n");
  for (unsigned seed = first; seed < first + seeds; ++seed) {
    const test::WamDraw draw = test::draw_wam(seed, 40.0);
    const IdentifyResult result = identify(draw.nominal, {draw.train}, {draw.test}, options);
    // The floor: what the truth itself leaves of the same rows.
    IdentifyOptions held = options;
    held.choice.fit = {"effects"};
    held.choice.effects = std::vector<std::string>{"torque_offset"};
    held.choice.fix = {"*friction*", "*armature*"};
    held.preprocess.filter_hz = result.plan.filter_hz;
    const IdentifyResult floor = identify(draw.truth, {draw.train}, {draw.test}, held);
    const test::Coverage c = test::coverage(result, draw.truth);
    all.inside += c.inside;
    all.of += c.of;
    std::printf("%4u  %3d/%-3d    ", seed, c.inside, c.of);
    for (std::size_t j = 0; j < result.errors.size(); ++j) {
      ratios.push_back(result.errors[j].test / floor.errors[j].nominal_test);
      std::printf(" %.3f", ratios.back());
    }
    std::printf("   filter %.1f Hz\n", result.plan.filter_hz);
    std::fflush(stdout);
  }
  std::ranges::sort(ratios);
  std::printf("base parameters inside their 95 %% intervals: %.1f %% of %d\n",
              100.0 * all.inside / all.of, all.of);
  std::printf("held-out error over noise floor: median %.3f, worst %.3f\n",
              ratios[ratios.size() / 2], ratios.back());
}
