#include <diffnea/core/text_file.hpp>
#include <diffnea/runs/ball_network_file.hpp>

#include "runs/run_reader.hpp"
#include "io/sha256.hpp"

namespace diffnea {
namespace {

using io::Json;
using io::JsonObject;

/// Rows of W, one an output, as the file has them.
DenseLayer read_layer(JsonObject& o) {
  DenseLayer out;
  out.bias = io::json_numbers(o.required("bias"), o.at("bias"));
  out.outputs = static_cast<int>(out.bias.size());
  const Json& rows = io::json_array(o.required("weights"), o.at("weights"));
  if (rows.size() != out.bias.size())
    throw ModelError(o.at("weights") + ": got " + std::to_string(rows.size()) + " rows, expected " +
                     std::to_string(out.bias.size()) + " (one per output)");
  // All of them before there is a matrix: one long row and many empty ones would ask for memory.
  std::vector<std::vector<double>> read;
  for (std::size_t r = 0; r < rows.size(); ++r)
    read.push_back(io::json_numbers(rows[r], o.at("weights") + "[" + std::to_string(r) + "]",
                                    r == 0 ? -1 : static_cast<long>(read[0].size())));
  if (!read.empty()) out.inputs = static_cast<int>(read[0].size());
  for (int i = 0; i < out.inputs; ++i)
    for (const std::vector<double>& row : read)
      out.weights.push_back(row[static_cast<std::size_t>(i)]);
  o.finish();
  return out;
}

std::vector<DenseLayer> read_layers(JsonObject& parent, const char* key) {
  std::vector<DenseLayer> out;
  parent.required(key);
  io::for_each_object(parent, key, [&](JsonObject& o) { out.push_back(read_layer(o)); });
  return out;
}

void read_scaling(JsonObject& root, const char* key, std::vector<double>& mean,
                  std::vector<double>& scale) {
  JsonObject o(root.required(key), root.at(key));
  mean = io::json_numbers(o.required("mean"), o.at("mean"));
  scale = io::json_numbers(o.required("scale"), o.at("scale"));
  o.finish();
}

}  // namespace

BallNetwork ball_network_from_json(const std::string& text, const std::string& where) {
  const Json document = io::parse_json(text, where);
  JsonObject root(document, where);
  io::require_schema(root, where, "diffnea/ball-network/1");
  BallNetwork out;
  const std::string kind = root.string("kind");
  if (kind != "ff" && kind != "lstm")
    throw ModelError(root.at("kind") + ": got '" + kind + "'; choices: ff, lstm");
  out.step = root.number("step");
  out.warm_up = root.number("warm_up");
  read_scaling(root, "input", out.input_mean, out.input_scale);
  read_scaling(root, "output", out.output_mean, out.output_scale);
  root.required("members");
  io::for_each_object(root, "members", [&](JsonObject& o) {
    out.members.push_back({read_layers(o, "cells"), read_layers(o, "layers")});
    o.finish();
    if (out.members.back().cells.empty() != (kind == "ff"))
      throw ModelError(o.at("cells") + ": expected " +
                       (kind == "ff" ? "none in a network of kind ff" : "one or more in an lstm"));
  });
  root.optional("training");  // how it was made: for people
  root.finish();
  check(out, where);
  out.source = where;
  out.text = text;
  out.sha256 = io::sha256(text);
  return out;
}

std::shared_ptr<const BallNetwork> read_ball_network(const std::filesystem::path& path) {
  return std::make_shared<BallNetwork>(ball_network_from_json(read_text_file(path), path.string()));
}

}  // namespace diffnea
