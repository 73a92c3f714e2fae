#pragma once
/// SIMD packs as a scalar: one state per lane. Internal: the width depends on the compiler's flags,
/// so no public header may include this, and only files that diffnea_add_isa_kernels builds may use
/// it.
///
/// `native_simd` is as wide as a register: wider packs spill (gcc 12, ABA: 65 ns a lane at 8 lanes
/// of AVX-512, 349 at 16). Its type, and so the name of every template over it, differs between
/// instruction sets.

#include <bit>
#include <cstdint>
#include <experimental/simd>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// As many doubles as a register holds, one a SIMD lane.
using Pack = std::experimental::native_simd<double>;
/// Lanes of a pack: 2 with SSE2, 4 with AVX2, 8 with AVX-512.
inline constexpr int kPackWidth = static_cast<int>(Pack::size());

/// A pack is its own value; what is compared with it is one bool a lane, for select().
inline const Pack& value(const Pack& a) { return a; }

/// Value in one lane: a pack as a whole cannot be looked at by a branch.
inline double value(const Pack& a, int lane) { return a[static_cast<std::size_t>(lane)]; }

/// `condition ? a : b`, lane by lane.
inline Pack select(const Pack::mask_type& condition, const Pack& a, const Pack& b) {
  Pack out = b;
  std::experimental::where(condition, out) = a;
  return out;
}

/// eˣ for |x| ≤ 700, to 2 units in the last place: Cephes' rational approximation (Moshier 1989) on
/// |x| ≤ ½ ln 2. (libstdc++'s takes the lanes one by one: 12 times as long.)
inline Pack exp_of(const Pack& x) {
  const Pack magic(0x1.8p52);  // adding it leaves an integer in the low bits
  const Pack shifted = x * Pack(1.4426950408889634) + magic, n = shifted - magic;
  const Pack r = x - n * Pack(6.93145751953125e-1) - n * Pack(1.42860682030941723212e-6);
  const Pack rr = r * r;
  const Pack p =
      r *
      ((Pack(1.26177193074810590878e-4) * rr + Pack(3.02994407707441961300e-2)) * rr + Pack(1.0));
  const Pack q = ((Pack(3.00198505138664455042e-6) * rr + Pack(2.52448340349684104192e-3)) * rr +
                  Pack(2.27265548208155028766e-1)) *
                     rr +
                 Pack(2.0);
  alignas(Pack) double power[kPackWidth];  // 2ⁿ
  shifted.copy_to(power, std::experimental::vector_aligned);
  for (double& a : power) a = std::bit_cast<double>((std::bit_cast<std::uint64_t>(a) + 1023) << 52);
  return (Pack(1.0) + Pack(2.0) * p / (q - p)) * Pack(power, std::experimental::vector_aligned);
}

/// (1 − e^{−x})/x for x ≥ 0.
inline Pack fading(const Pack& x) {
  const Pack far = select(x > Pack(700.0), Pack(700.0), x);
  const Pack near = Pack(1.0) - x * (Pack(0.5) - x * Pack(1.0 / 6.0));
  const Pack safe = select(x > Pack(1e-4), x, Pack(1.0));
  return select(x > Pack(1e-4), Pack((Pack(1.0) - exp_of(-far)) / safe), near);
}

/// sin x and cos x together for |x| < 1e5, to 1e-16: Cephes' polynomials on |x| ≤ π/4.
inline void sin_cos(const Pack& x, Pack& s, Pack& c) {
  using std::experimental::floor;
  const Pack n = floor(x * Pack(0.63661977236758134308) + Pack(0.5));  // quarter turns
  const Pack r = x - n * Pack(1.57079625129699707031) - n * Pack(7.54978941586159635336e-8) -
                 n * Pack(5.39030285815811905290e-15);
  const Pack z = r * r;
  const Pack sine =
      r + r * z *
              (((((Pack(1.58962301576546568060e-10) * z - Pack(2.50507477628578072866e-8)) * z +
                  Pack(2.75573136213857245213e-6)) *
                     z -
                 Pack(1.98412698295895385996e-4)) *
                    z +
                Pack(8.33333333332211858878e-3)) *
                   z -
               Pack(1.66666666666666307295e-1));
  const Pack cosine =
      Pack(1.0) - Pack(0.5) * z +
      z * z *
          (((((Pack(-1.13585365213876817300e-11) * z + Pack(2.08757008419747316778e-9)) * z -
              Pack(2.75573141792967388112e-7)) *
                 z +
             Pack(2.48015872888517045348e-5)) *
                z -
            Pack(1.38888888888730564116e-3)) *
               z +
           Pack(4.16666666666665929218e-2));
  const Pack quadrant = n - Pack(4.0) * floor(n * Pack(0.25));
  const Pack::mask_type turned = quadrant == Pack(1.0) || quadrant == Pack(3.0);
  s = select(turned, cosine, sine);
  c = select(turned, sine, cosine);
  s = select(quadrant >= Pack(2.0), Pack(-s), s);
  c = select(quadrant == Pack(1.0) || quadrant == Pack(2.0), Pack(-c), c);
}

/// tanh, to 4 units in the last place: x + x³ P/Q of Cephes where |x| < 0.625, else by eˣ.
inline Pack smooth_sign(const Pack& x) {
  using std::experimental::abs;
  const Pack xx = x * x, size = abs(x);
  const Pack p = (Pack(-9.64399179425052238628e-1) * xx + Pack(-9.92877231001918586564e1)) * xx +
                 Pack(-1.61468768441708447952e3);
  const Pack q =
      ((xx + Pack(1.12811678491632931402e2)) * xx + Pack(2.23548839060100448583e3)) * xx +
      Pack(4.84406305325125486048e3);
  const Pack small = x + x * xx * (p / q);
  const Pack most = select(size > Pack(20.0), Pack(20.0), size);  // there it is 1
  const Pack large = Pack(1.0) - Pack(2.0) / (exp_of(most + most) + Pack(1.0));
  return select(size < Pack(0.625), small, select(x < Pack(0.0), Pack(-large), large));
}

}  // namespace diffnea
