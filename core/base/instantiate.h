#pragma once

// Compiles a template on the manifold's dimension k once, in its own source, for each k that this
// build supports (kMaxDimension).
#define STELLATE_DECLARE_CLASS(Class) \
  extern template class Class<1>;     \
  extern template class Class<2>;     \
  extern template class Class<3>;     \
  extern template class Class<4>;     \
  extern template class Class<5>;

#define STELLATE_INSTANTIATE_CLASS(Class) \
  template class Class<1>;                \
  template class Class<2>;                \
  template class Class<3>;                \
  template class Class<4>;                \
  template class Class<5>;

// The same for functions: Each(k) is the instantiation for one k.
#define STELLATE_INSTANTIATE_FUNCTIONS(Each) Each(1) Each(2) Each(3) Each(4) Each(5)
