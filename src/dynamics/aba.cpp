#include <diffnea/dynamics/aba.hpp>

namespace diffnea {

#define DIFFNEA_INSTANTIATE(P, S)                                                          \
  template const VecX<Prod<P, S>>& aba<P, S>(const Tree<P>&, VecIn<S>, VecIn<S>, VecIn<S>, \
                                             AbaWorkspace<P, S>&);
DIFFNEA_FOR_EACH_SCALAR(DIFFNEA_INSTANTIATE)

}  // namespace diffnea
