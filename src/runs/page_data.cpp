#include <algorithm>
#include <cmath>

#include <diffnea/runs/page_data.hpp>

#include "runs/fields_json.hpp"
#include "runs/movement_json.hpp"

namespace diffnea {
namespace {

using io::Json;
using io::number;

/// Points of all series of one list: at 5 numbers of some 10 characters each, below 2 MB.
constexpr std::size_t kMostPoints = 35'000;
constexpr long kMostRows = 1000;  ///< rows of a movement

template <class Series>
std::size_t stride_of(const std::vector<Series>& list) {
  std::size_t points = 0;
  for (const Series& s : list) points += s.time.size();
  return std::max<std::size_t>(1, (points + kMostPoints - 1) / kMostPoints);
}

std::vector<double> thinned(const std::vector<double>& values, std::size_t stride) {
  if (stride == 1) return values;
  std::vector<double> out;
  for (std::size_t k = 0; k < values.size(); k += stride) out.push_back(values[k]);
  return out;
}

std::vector<TorqueSeries> thinned(const std::vector<TorqueSeries>& list) {
  const std::size_t stride = stride_of(list);
  std::vector<TorqueSeries> out;
  for (const TorqueSeries& s : list)
    out.push_back({s.joint, s.unit, thinned(s.time, stride), thinned(s.measured, stride),
                   thinned(s.fitted, stride), thinned(s.nominal, stride),
                   thinned(s.velocity, stride)});
  return out;
}

/// Every n-th row, and those at which a window begins or ends: there both models have no value.
SimulatedSeries thinned(const SimulatedSeries& s, std::size_t stride) {
  const auto ends = [&](std::size_t k) {
    return std::isnan(s.base[k]) && std::isnan(s.extended[k]);
  };
  SimulatedSeries out;
  out.joint = s.joint;
  out.unit = s.unit;
  for (std::size_t k = 0; k < s.time.size(); ++k) {
    if (k % stride != 0 && !ends(k) && !(k > 0 && ends(k - 1))) continue;
    out.time.push_back(s.time[k]);
    out.measured.push_back(s.measured[k]);
    out.base.push_back(s.base[k]);
    out.extended.push_back(s.extended[k]);
  }
  return out;
}

/// One line of two files, which end with a line's end.
std::string data(const Json& result, std::string series) {
  std::string out = "{\"result\":" + io::text(result, -1);
  out.back() = ',';
  series.back() = '}';
  return out + "\"series\":" + series;
}

/// null where it was not kept.
Json movement(const RolloutTrace& trace, const StickFigure& figure) {
  const long rows = trace.time.size();
  if (rows == 0 || figure.time.size() != rows) return {};
  std::vector<long> kept;
  for (long k = 0; k < rows; k += (rows + kMostRows - 1) / kMostRows) kept.push_back(k);
  if (kept.back() != rows - 1) kept.push_back(rows - 1);
  RolloutTrace some = trace;
  some.time = trace.time(kept);
  some.values = trace.values(kept, Eigen::all);
  StickFigure drawn = figure;
  drawn.time = some.time;
  drawn.across = figure.across(kept, Eigen::all);
  drawn.up = figure.up(kept, Eigen::all);
  return io::movement(some, &drawn);
}

/// Columns of a search that the page draws, to 6 digits.
Json curve(const std::vector<ErepsIteration>& history) {
  const Json all = io::columns_json(history);
  Json out = Json::object();
  for (const char* key :
       {"reward_mean", "reward_best", "solved_share", "entropy", "kl_samples", "kl_update"})
    out[key] = io::rounded(all.at(key).get<std::vector<double>>());
  return out;
}

bool holds(const std::vector<int>& shown, std::size_t index) {
  return std::ranges::find(shown, static_cast<int>(index)) != shown.end();
}

}  // namespace

std::string page_data(const FitRun& run) {
  IdentifyResult shown;
  shown.train_series = thinned(run.fit.train_series);
  shown.test_series = thinned(run.fit.test_series);
  shown.ball = run.fit.ball;
  Json horizons = Json::array();
  for (const HorizonError& e : run.fit.horizons) horizons.push_back(io::fields_json(e, kInResult));
  return data({{"ball", io::json_of(run.fit.ball, kInResult)}, {"horizons", horizons}},
              series_json(shown));
}

std::string page_data(const DiagnoseRun& run) {
  const Finding& f = run.finding;
  Finding shown;
  const std::size_t stride = stride_of(f.series);
  for (const ResidualSeries& s : f.series)
    shown.series.push_back({s.joint,
                            s.unit,
                            thinned(s.time, stride),
                            thinned(s.measured, stride),
                            thinned(s.base, stride),
                            thinned(s.extended, stride),
                            {},
                            {},
                            {}});
  const std::size_t every = stride_of(f.simulated.joints);
  for (const SimulatedSeries& s : f.simulated.joints)
    shown.simulated.joints.push_back(thinned(s, every));
  shown.grey_box = f.grey_box;
  shown.plots = f.plots;
  shown.ball = f.ball;
  Json horizons = Json::array(), joints = Json::array();
  for (const SimulatedHorizon& h : f.simulated.horizons)
    horizons.push_back(io::fields_json(h, kInResult));
  for (const SimulatedSeries& s : f.simulated.joints)
    joints.push_back({{"unit", s.unit}, {"tolerance", number(s.tolerance)}});
  Json grey_box = Json::array();
  for (const GreyBox& g : f.grey_box) grey_box.push_back({{"unit", g.unit}});
  return data(
      {{"ball", io::json_of(f.ball, kInResult)},
       {"simulated",
        {{"window", number(f.simulated.window)}, {"horizons", horizons}, {"joints", joints}}},
       {"grey_box", grey_box}},
      diagnose_series_json(shown));
}

std::string page_data(const LearnRun& run, const std::vector<int>& shown) {
  Json policies = Json::array(), imagined = Json::array();
  for (std::size_t i = 0; i < run.policies.size(); ++i) {
    policies.push_back({{"curve", curve(run.policies[i].curve)}});
    imagined.push_back(holds(shown, i) ? movement(run.imagined.at(i), run.figures.at(i)) : Json());
  }
  return data({{"policies", policies}}, io::text({{"imagined", imagined}}, -1));
}

std::string page_data(const TransferRun& run, const std::vector<int>& shown) {
  Json policies = Json::array(), imagined = Json::array(), obtained = Json::array();
  for (std::size_t i = 0; i < run.executions.size(); ++i) {
    const Execution& e = run.executions[i];
    policies.push_back({{"expected", number(run.policies.at(i).expected)},
                        {"reward", number(e.reward)},
                        {"success", e.success()}});
    const bool is_shown = holds(shown, i);
    imagined.push_back(is_shown ? movement(run.imagined.at(i), run.imagined_figures.at(i))
                                : Json());
    obtained.push_back(is_shown ? movement(e.trace, run.figures.at(i)) : Json());
  }
  return data({{"policies", policies}},
              io::text({{"imagined", imagined}, {"obtained", obtained}}, -1));
}

}  // namespace diffnea
