#pragma once
/// Numbers of a pack's worlds, lane by lane: rows of memory, and parameters that are drawn.
/// Included by what pack_world.cpp is made of, once per instruction set.

#include <vector>

#include <diffnea/core/pack.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/model/tree.hpp>

#include "sim/pack_world.hpp"

namespace diffnea::sim {
namespace DIFFNEA_ISA {

using Mask = Pack::mask_type;

inline Pack load(const double* row) { return Pack(row, std::experimental::element_aligned_tag{}); }
inline void store(const Pack& x, double* row) {
  x.copy_to(row, std::experimental::element_aligned_tag{});
}
/// @param row  moved behind what was stored
inline void store(const Vec3<Pack>& v, double*& row) {
  for (const Pack& x : {v.x, v.y, v.z}) {
    store(x, row);
    row += kPackWidth;
  }
}

inline Vec3<Pack> choose(const Mask& condition, const Vec3<Pack>& a, const Vec3<Pack>& b) {
  return {select(condition, a.x, b.x), select(condition, a.y, b.y), select(condition, a.z, b.z)};
}

/// Lane l's draw.
using LaneDraws = std::vector<const PackDraw*>;

/// Lane l's number is get(draw of lane l).
template <class Get>
Pack gather(const LaneDraws& draws, const Get& get) {
  return Pack([&](auto lane) { return get(*draws[lane]); });
}

inline Vec3<Pack> gather_vector(const LaneDraws& d, Vec3<double> (*get)(const PackDraw&)) {
  return {gather(d, [&](const PackDraw& x) { return get(x).x; }),
          gather(d, [&](const PackDraw& x) { return get(x).y; }),
          gather(d, [&](const PackDraw& x) { return get(x).z; })};
}

/// (effects), each with its parameters in the member `of` of the lanes' draws.
inline std::vector<std::vector<Pack>> gather_parameters(
    const LaneDraws& draws, const std::vector<BoundEffect>& effects,
    std::vector<std::vector<double>> PackDraw::* of) {
  std::vector<std::vector<Pack>> out(effects.size());
  for (std::size_t e = 0; e < out.size(); ++e) {
    out[e].resize(effects[e].parameters.size());
    for (std::size_t k = 0; k < out[e].size(); ++k)
      out[e][k] = gather(draws, [&](const PackDraw& d) { return (d.*of)[e][k]; });
  }
  return out;
}

inline Tree<Pack> gather_tree(const LaneDraws& d) {
  Tree<Pack> out = d.front()->tree.cast<Pack>();
  for (std::size_t i = 0; i < out.links.size(); ++i) {
    Link<Pack>& link = out.links[i];
    const auto of = [&](auto get) {
      return gather(d, [&](const PackDraw& x) { return get(x.tree.links[i]); });
    };
    using L = const Link<double>&;
    link.armature = of([](L l) { return l.armature; });
    link.inertia.m = of([](L l) { return l.inertia.m; });
    link.inertia.h = {of([](L l) { return l.inertia.h.x; }), of([](L l) { return l.inertia.h.y; }),
                      of([](L l) { return l.inertia.h.z; })};
    link.inertia.I = {
        of([](L l) { return l.inertia.I.xx; }), of([](L l) { return l.inertia.I.xy; }),
        of([](L l) { return l.inertia.I.xz; }), of([](L l) { return l.inertia.I.yy; }),
        of([](L l) { return l.inertia.I.yz; }), of([](L l) { return l.inertia.I.zz; })};
    link.X_PJ.p = {of([](L l) { return l.X_PJ.p.x; }), of([](L l) { return l.X_PJ.p.y; }),
                   of([](L l) { return l.X_PJ.p.z; })};
    for (int c = 0; c < 3; ++c)
      link.X_PJ.R.col[c] = {of([c](L l) { return l.X_PJ.R.col[c].x; }),
                            of([c](L l) { return l.X_PJ.R.col[c].y; }),
                            of([c](L l) { return l.X_PJ.R.col[c].z; })};
  }
  const auto gravity = [](const PackDraw& x) { return x.tree.gravity; };
  out.gravity = gather_vector(d, gravity);
  return out;
}

}  // namespace DIFFNEA_ISA
}  // namespace diffnea::sim
