#include <algorithm>
#include <limits>
#include <tuple>

#include <diffnea/runs/diagnosis.hpp>

#include "runs/ball_json.hpp"
#include "runs/run_reader.hpp"

namespace diffnea {
namespace {

using io::count;
using io::for_each_object;
using io::Json;
using io::JsonObject;
using io::number_or_nan;
using io::strings;

/// [low, high] of a key; NaN both where it is missing.
std::pair<double, double> interval(JsonObject& o, const char* key) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  if (!o.optional(key)) return {nan, nan};
  const std::vector<double> ends = io::column(o, key);
  if (ends.size() != 2)
    throw ModelError(o.at(key) + ": has " + std::to_string(ends.size()) +
                     " numbers, expected the 2 ends of an interval");
  return {ends[0], ends[1]};
}

Gain read_gain(JsonObject& parent) {
  Gain out;
  const Json* value = parent.optional("gain");
  if (!value) return out;
  JsonObject o(*value, parent.at("gain"));
  out.before = number_or_nan(o, "test_rmse_before");
  out.after = number_or_nan(o, "test_rmse_after");
  out.noise_floor = number_or_nan(o, "noise_floor");
  out.explained_share = number_or_nan(o, "explained_share");
  std::tie(out.low, out.high) = interval(o, "ci95");
  return out;
}

std::vector<Rival> read_rivals(JsonObject& parent, const char* key) {
  std::vector<Rival> out;
  for_each_object(parent, key, [&](JsonObject& o) {
    out.push_back({o.string("effect"), o.string("where"), number_or_nan(o, "delta_bic")});
  });
  return out;
}

Cause read_cause(JsonObject& o) {
  Cause c;
  c.effect = o.string("effect");
  c.where = o.string("where");
  c.verdict = verdict_from(o.string("verdict"));
  for_each_object(o, "parameters", [&](JsonObject& of) {
    CauseParameter p;
    p.name = of.string("name");
    p.unit = of.string("unit");
    p.value = number_or_nan(of, "value");
    p.std = number_or_nan(of, "std");
    std::tie(p.low, p.high) = interval(of, "ci95");
    c.parameters.push_back(p);
  });
  c.delta_bic = number_or_nan(o, "delta_bic");
  c.lm = number_or_nan(o, "lm");
  c.visible_share = number_or_nan(o, "visible_share");
  c.torque_share = number_or_nan(o, "torque_share");
  c.members = read_rivals(o, "class");
  c.rivals = read_rivals(o, "rivals");
  c.gain = read_gain(o);
  return c;
}

void read_faults(JsonObject& root, Finding& f) {
  for_each_object(root, "audit", [&](JsonObject& o) {
    ChannelFault a;
    a.fault = o.string("fault");
    a.where = o.string("where");
    a.channel = o.string_or("channel", "");
    a.value = number_or_nan(o, "value");
    a.unit = o.string_or("unit", "1");
    a.std = number_or_nan(o, "std");
    a.significance = number_or_nan(o, "significance");
    a.severity =
        o.string_or("severity", "fault") == "note" ? FaultSeverity::kNote : FaultSeverity::kFault;
    a.source = o.string_or("source", "");
    a.evidence = o.string_or("evidence", "");
    f.audit.push_back(a);
  });
}

/// What was tried beside the causes, and what is left.
void read_rest(JsonObject& root, Finding& f) {
  for_each_object(root, "witness", [&](JsonObject& o) {
    f.witness.push_back({o.string("where"), strings(o, "variables"), number_or_nan(o, "share"),
                         number_or_nan(o, "delta_bic")});
  });
  for_each_object(root, "grey_box", [&](JsonObject& o) {
    GreyBox g;
    g.where = o.string("where");
    g.unit = o.string("unit");
    g.variables = strings(o, "variables");
    g.bumps = static_cast<int>(count(o, "bumps"));
    g.effective_parameters = number_or_nan(o, "effective_parameters");
    g.bound = number_or_nan(o, "bound");
    g.torque_rms = number_or_nan(o, "torque_rms");
    g.before = number_or_nan(o, "before");
    g.after = number_or_nan(o, "after");
    f.grey_box.push_back(std::move(g));
  });
  for_each_object(root, "absorbed", [&](JsonObject& o) {
    f.absorbed.push_back(
        {o.string("effect"), o.string("where"), number_or_nan(o, "visible_share")});
  });
  for_each_object(root, "refused", [&](JsonObject& o) {
    f.refused.push_back({o.string("effect"), o.string("where"), o.string_or("reason", ""),
                         number_or_nan(o, "delta_bic")});
  });
  for_each_object(root, "candidates", [&](JsonObject& o) {
    CandidateScore c{o.string("effect"),
                     o.string("where"),
                     number_or_nan(o, "delta_bic"),
                     number_or_nan(o, "lm"),
                     number_or_nan(o, "visible_share"),
                     {}};
    if (o.optional("shape")) c.shape = io::column(o, "shape");
    f.candidates.push_back(c);
  });
  if (const Json* value = root.optional("next_experiment")) {
    JsonObject o(*value, root.at("next_experiment"));
    NextExperiment next;
    next.sentence = o.string("sentence");
    next.expected_delta_bic = number_or_nan(o, "expected_delta_bic");
    next.trajectory = o.string_or("trajectory", "");
    for_each_object(o, "pairs", [&](JsonObject& p) {
      next.pairs.push_back({p.string("effect"), p.string("where"), p.string("rival"),
                            p.string("rival_where"), number_or_nan(p, "delta_bic"),
                            number_or_nan(p, "expected_delta_bic")});
    });
    f.next_experiment = next;
  }
}

void read_preprocessing(JsonObject& root, Finding& f) {
  JsonObject p(root.required("preprocessing"), root.at("preprocessing"));
  f.plan.filter_hz = number_or_nan(p, "filter_hz");
  f.plan.decimator.rate_hz = number_or_nan(p, "decimated_to_hz");
  f.plan.decimator.factor = 1;
  f.data_report.quarantined = count(p, "quarantined");
  f.data_report.extra_channels = strings(p, "extra_channels");
  f.data_report.notes = strings(p, "notes");
}

void read_simulated(JsonObject& root, SimulatedMotion& m) {
  const Json* value = root.optional("simulated");
  if (!value) return;
  JsonObject o(*value, root.at("simulated"));
  m.driven_by = o.string_or("driven_by", "");
  m.window = number_or_nan(o, "window");
  m.windows = static_cast<int>(count(o, "windows"));
  JsonObject failed(o.required("failed"), o.at("failed"));
  m.base_failed = static_cast<int>(count(failed, "base"));
  m.extended_failed = static_cast<int>(count(failed, "extended"));
  m.reason = o.string_or("reason", "");
  for_each_object(o, "joints", [&](JsonObject& j) {
    SimulatedSeries s;
    s.joint = j.string("joint");
    s.unit = j.string("unit");
    s.base_rmse = number_or_nan(j, "rmse_base");
    s.extended_rmse = number_or_nan(j, "rmse_extended");
    m.joints.push_back(std::move(s));
  });
}

/// @throws ModelError if the columns differ in length
void check_lengths(JsonObject& o, const char* first, std::size_t expected,
                   const std::vector<const std::vector<double>*>& columns) {
  for (const std::vector<double>* c : columns)
    if (c->size() != expected)
      throw ModelError(o.at(first) + ": has " + std::to_string(expected) +
                       " values, another column " + std::to_string(c->size()));
}

void read_series(JsonObject& root, Finding& f) {
  for_each_object(root, "joints", [&](JsonObject& o) {
    ResidualSeries s;
    s.joint = o.string("joint");
    s.unit = o.string("unit");
    s.time = io::column(o, "time");
    s.measured = io::column(o, "measured");
    s.base = io::column(o, "base");
    s.extended = io::column(o, "extended");
    s.q = io::column(o, "q");
    s.qd = io::column(o, "qd");
    s.qdd = io::column(o, "qdd");
    check_lengths(o, "time", s.time.size(),
                  {&s.measured, &s.base, &s.extended, &s.q, &s.qd, &s.qdd});
    f.series.push_back(std::move(s));
  });
  if (root.optional("simulated"))
    for_each_object(root, "simulated", [&](JsonObject& o) {
      const std::string joint = o.string("joint");
      const auto at = std::ranges::find(f.simulated.joints, joint, &SimulatedSeries::joint);
      if (at == f.simulated.joints.end())
        throw ModelError(o.at("joint") + ": got '" + joint +
                         "', which result.json has no simulated motion of");
      at->time = io::column(o, "time");
      at->measured = io::column(o, "measured");
      at->base = io::column(o, "base");
      at->extended = io::column(o, "extended");
      check_lengths(o, "time", at->time.size(), {&at->measured, &at->base, &at->extended});
    });
  for_each_object(root, "grey_box", [&](JsonObject& o) {
    const std::string where = o.string("where");
    const auto g = std::ranges::find(f.grey_box, where, &GreyBox::where);
    if (g == f.grey_box.end())
      throw ModelError(o.at("where") + ": got '" + where +
                       "', which result.json has no grey box of");
    g->units = strings(o, "units");
    std::size_t points = 1;
    int k = 0;
    const Json& at = o.required("at");
    for (const Json& values : io::json_array(at, o.at("at"))) {
      const int size = static_cast<int>(values.size());
      g->at.push_back(io::json_numbers(values, o.at("at") + "[" + std::to_string(k++) + "]", size));
      points *= g->at.back().size();
    }
    g->torque = io::column(o, "torque");
    g->std = io::column(o, "std");
    check_lengths(o, "at", points, {&g->torque, &g->std});
  });
  for_each_object(root, "plots", [&](JsonObject& o) {
    EvidencePlot p;
    p.kind = o.string("kind");
    p.joint = o.string("joint");
    p.effect = o.string_or("effect", "");
    p.x_name = o.string("x_name");
    p.x_unit = o.string("x_unit");
    p.y_name = o.string("y_name");
    p.y_unit = o.string("y_unit");
    p.mark = number_or_nan(o, "mark");
    p.x = io::column(o, "x");
    for_each_object(o, "curves", [&](JsonObject& c) {
      p.curves.push_back(
          {c.string("model"), io::column(c, "mean"), io::column(c, "low"), io::column(c, "high")});
      check_lengths(c, "mean", p.x.size(),
                    {&p.curves.back().mean, &p.curves.back().low, &p.curves.back().high});
    });
    f.plots.push_back(std::move(p));
  });
}

}  // namespace

DiagnoseRun read_diagnose_run(const std::filesystem::path& folder) {
  DiagnoseRun run;
  const std::string where = (folder / "result.json").string();
  const Json document = io::run_file(folder, "result.json");
  JsonObject root(document, where);
  io::require_schema(root, where, "diffnea/diagnose/1");
  Finding& f = run.finding;
  f.model.name = root.string_or("model", "");
  f.verdict = verdict_from(root.string("verdict"));
  f.sentence = root.string("sentence");
  f.base = root.string_or("base", "");
  f.held_out = root.string_or("held_out", "");
  f.notes = strings(root, "notes");
  read_faults(root, f);
  for_each_object(root, "causes", [&](JsonObject& o) { f.causes.push_back(read_cause(o)); });
  read_rest(root, f);
  f.gain = read_gain(root);
  for_each_object(root, "joints", [&](JsonObject& o) {
    f.joints.push_back({o.string("joint"), o.string("unit"), number_or_nan(o, "torque_rms"),
                        number_or_nan(o, "base"), number_or_nan(o, "extended"),
                        number_or_nan(o, "noise_floor")});
  });
  if (root.optional("noise")) f.noise = io::column(root, "noise");
  if (const Json* value = root.optional("lack_of_fit")) {
    JsonObject o(*value, root.at("lack_of_fit"));
    f.lack_of_fit = number_or_nan(o, "f");
    f.lack_of_fit_p = number_or_nan(o, "p");
  }
  read_simulated(root, f.simulated);
  f.ball = io::read_ball_summary(root);
  read_preprocessing(root, f);
  JsonObject summary(root.required("summary"), root.at("summary"));
  f.seconds = number_or_nan(summary, "seconds");
  f.interrupted = summary.boolean_or("interrupted", false);
  io::read_reproduce(root, run.reproduce);
  if (const auto path = folder / "series.json"; std::filesystem::exists(path)) {
    const Json json = io::run_file(folder, "series.json");
    JsonObject object(json, path.string());
    io::require_schema(object, path.string(), "diffnea/diagnose-series/1");
    read_series(object, f);
    io::read_ball_columns(object, f.ball);
  }
  return run;
}

}  // namespace diffnea
