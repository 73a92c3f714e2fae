/// Time and memory of whole identifications: `make bench`. Wall-clock medians of several runs.
///
///     diffnea_bench_identify                 all of it
///     diffnea_bench_identify --motion    the motion loss alone
///     diffnea_bench_identify --once FILE     one identification of FILE, which a process of its
///     own measures

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <sys/resource.h>
#include <thread>
#include <vector>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/torque_regression.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/recording/csv.hpp>
#include <diffnea/worlds/surrogate.hpp>

#include "support/temporary_folder.hpp"
#include "support/wam_study.hpp"

using namespace diffnea;
using namespace diffnea::test;

namespace {

constexpr int kRepeats = 100;

double seconds_of(const std::function<void()>& call) {
  const auto start = std::chrono::steady_clock::now();
  call();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

/// Seconds, median of `rounds`.
double median_seconds(int rounds, const std::function<void()>& call) {
  std::vector<double> out;
  for (int k = 0; k < rounds; ++k) out.push_back(seconds_of(call));
  return median(out);
}

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

Model wam() { return read_model(std::string(DIFFNEA_SOURCE_DIR) + "/models/wam4.xml"); }

IdentifyOptions wam_options() {
  IdentifyOptions options;
  options.choice.effects =
      std::vector<std::string>{"armature", "viscous_friction", "coulomb_friction"};
  return options;
}

long read_only(const std::filesystem::path& path) {
  RecordingReader reader(path);
  Recording block;
  long rows = 0;
  while (reader.next(block, 16384)) rows += block.rows();
  return rows;
}

IdentifyResult identify_file(const Model& model, const std::filesystem::path& path) {
  return identify(model, *recordings_in_files(model, {path}, {}), nullptr, wam_options());
}

/// The same rows many times over, one run each.
void repeat(const std::filesystem::path& from, const std::filesystem::path& to, int times) {
  std::ifstream in(from);
  std::string header, text;
  std::getline(in, header);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  std::ofstream out(to);
  out << header << ",run\n";
  for (int k = 0; k < times; ++k)
    for (const std::string& line : lines) out << line << ',' << k << '\n';
  if (!out) throw FileError(to.string() + ": cannot be written");
}

struct Once {
  double total = 0.0, reading = 0.0, memory = 0.0;  ///< [s], [s], [MB]
  long rows = 0;
  int iterations = 0;
};

/// In a process of its own: memory that the parent holds, or gave back, does not count.
Once in_own_process(const std::filesystem::path& path) {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
  const std::string command = "'" + program + "' --once '" + path.string() + "'";
  FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) throw Error("bench_identify: cannot start " + program);
  Once out;
  const int got = std::fscanf(pipe, "%lf %lf %lf %ld %d", &out.total, &out.reading, &out.memory,
                              &out.rows, &out.iterations);
  if (::pclose(pipe) != 0 || got != 5) throw Error("bench_identify: the run of its own failed");
  return out;
}

int once(const std::filesystem::path& path) {
  const Model model = wam();
  IdentifyResult result;
  const double total = seconds_of([&] { result = identify_file(model, path); });
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const double reading = seconds_of([&] { read_only(path); });
  std::printf("%.6f %.6f %.3f %ld %d\n", total, reading,
              static_cast<double>(usage.ru_maxrss) / 1024.0, result.summary.rows,
              result.summary.iterations);
  return 0;
}

void bench_wam() {
  const WamDraw draw = draw_wam(1, 40.0);
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "wam.csv",
                              large = folder.path() / "wam_100.csv";
  write_recording(draw.train, file);
  const Model model = wam();

  std::printf(
      "\nWAM-4, %ld rows from CSV, inertia + armature + friction, inverse loss, one thread\n",
      draw.train.rows());
  IdentifyResult result;
  const double total = median_seconds(11, [&] { result = identify_file(model, file); });
  // The stages by themselves.
  const double parsing = median_seconds(11, [&] { read_only(file); });
  const auto source = recordings_in_files(model, {file}, {});
  const std::vector<Recording> sample = source->sample();
  PreprocessPlan plan;
  const double planning = median_seconds(11, [&] { plan = plan_preprocess(sample); });
  FitLayout layout = make_layout(model, wam_options().choice, {0});
  VecX<double> shape(static_cast<long>(layout.shape.size()));
  for (std::size_t s = 0; s < layout.shape.size(); ++s)
    shape[static_cast<long>(s)] = layout.shape[s].prior;
  std::vector<JointFactor> factors;
  const double factoring = median_seconds(11, [&] {
    TorqueRegression regression(model, layout, plan, {layout.prior(), shape});
    regression.add(preprocess(sample[0], plan));
    factors = regression.factors();
  });
  for (const int c : absorbed_by_links(layout, factors)) layout.linear[c].fixed = true;
  LinearFit fit;
  const double solving = median_seconds(11, [&] { fit = fit_linear(layout, factors); });
  int free = 0;
  for (const FitParameter& p : layout.linear) free += p.fixed ? 0 : 1;
  std::printf("  total                          %7.1f ms   (target 500)\n", 1e3 * total);
  std::printf("    parsing the file             %7.1f ms\n", 1e3 * parsing);
  std::printf("    choosing filters             %7.1f ms\n", 1e3 * planning);
  std::printf("    rows, filters, factor        %7.1f ms\n", 1e3 * factoring);
  std::printf(
      "    iterations                   %7.1f ms   (target 50): %d free parameters, %d Newton "
      "steps in "
      "the last of the fits that weigh the joints\n",
      1e3 * solving, free, fit.solver.iterations);

  repeat(file, large, kRepeats);
  std::vector<Once> small, big;
  for (int k = 0; k < 3; ++k) {
    small.push_back(in_own_process(file));
    big.push_back(in_own_process(large));
  }
  const auto middle = [](const std::vector<Once>& all, double Once::* value) {
    std::vector<double> out;
    for (const Once& o : all) out.push_back(o.*value);
    return median(out);
  };
  const double t1 = middle(small, &Once::total), t100 = middle(big, &Once::total);
  const double r1 = middle(small, &Once::reading), r100 = middle(big, &Once::reading);
  std::printf("\n%d times the samples: %ld rows, %.0f MB, streamed; each in a process of its own\n",
              kRepeats, big[0].rows, static_cast<double>(std::filesystem::file_size(large)) / 1e6);
  std::printf("  total                          %7.2f s, of it parsing %.2f s\n", t100, r100);
  std::printf("  over the total of one time     %7.1f     (target 110)\n", t100 / t1);
  std::printf("  over reading of one time       %7.1f     (parsing alone, %.1f ms)\n", t100 / r1,
              1e3 * r1);
  std::printf(
      "  over the pass of one time      %7.1f     (parsing, rows, filters, factor: %.1f ms)\n",
      t100 / (r1 + factoring), 1e3 * (r1 + factoring));
  std::printf("  memory, growth                 %7.1f MB  (target 200): from %.1f to %.1f MB\n",
              middle(big, &Once::memory) - middle(small, &Once::memory),
              middle(small, &Once::memory), middle(big, &Once::memory));
  std::printf("  Newton steps                   %7d     (one time: %d)\n", big[0].iterations,
              small[0].iterations);
}

void bench_motion() {
  const Model model = read_model(std::string(DIFFNEA_SOURCE_DIR) + "/models/panda.urdf");
  const Model truth = perturbed(model, surrogate_a(), 1);
  FourierOptions motion;
  motion.duration = 10.0;
  motion.seed = 1;
  const SimulatedRecording recorded = record_model(truth, model, random_fourier(model, motion));
  if (!recorded.failure.empty()) throw Error("bench_identify: " + recorded.failure);
  const Recording& r = recorded.recording;
  const auto source = recordings_in_memory(model, {r});

  std::vector<int> threads{1};
  if (const int all = static_cast<int>(std::thread::hardware_concurrency()); all > 1)
    threads.push_back(all);
  for (const int n : threads) {
    IdentifyOptions options = wam_options();
    options.loss = Loss::kMotion;
    options.motion.threads = n;
    IdentifyResult result;
    std::vector<double> total, fitting;
    for (int k = 0; k < 3; ++k) {
      total.push_back(seconds_of([&] { result = identify(model, *source, nullptr, options); }));
      fitting.push_back(result.summary.seconds_fitting);
    }
    int linear = 0, free = 0;
    for (const ParameterEstimate& p : result.parameters) {
      if (p.name.ends_with(".smoothing")) continue;
      ++linear;
      free += p.fixed ? 0 : 1;
    }
    double error = 0.0, floor = RecordOptions{}.position_noise;
    for (const JointError& e : result.errors) error = std::max(error, e.train);
    std::printf(
        "\nPanda, %ld rows of 10 s, motion loss, windows of up to %.1f s, %d parameters (%d free), "
        "%d "
        "thread%s\n",
        r.rows(), result.summary.horizon, linear, free, n, n == 1 ? "" : "s");
    std::printf("  total                          %7.2f s    (target 10), of it the fit %.2f s\n",
                median(total), median(fitting));
    std::printf("  %s after %d steps; largest position error %.3g rad (noise %.3g)\n",
                result.summary.termination.c_str(), result.summary.iterations, error, floor);
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[1]) == "--once") return once(argv[2]);
  if (argc == 2 && std::string(argv[1]) == "--motion") return bench_motion(), 0;
  std::printf("%s, %u cores\n", processor().c_str(), std::thread::hardware_concurrency());
  bench_wam();
  std::fflush(stdout);
  bench_motion();
}
