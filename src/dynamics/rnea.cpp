#include <diffnea/dynamics/rnea.hpp>

namespace diffnea {

#define DIFFNEA_INSTANTIATE(P, S)                                                           \
  template const VecX<Prod<P, S>>& rnea<P, S>(const Tree<P>&, VecIn<S>, VecIn<S>, VecIn<S>, \
                                              RneaWorkspace<P, S>&);                        \
  template const VecX<Prod<P, S>>& gravity_torques<P, S>(const Tree<P>&, VecIn<S>,          \
                                                         RneaWorkspace<P, S>&);
DIFFNEA_FOR_EACH_SCALAR(DIFFNEA_INSTANTIATE)

}  // namespace diffnea
