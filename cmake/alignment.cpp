// Carries Eigen's alignments in its text, so that they can be read without running it.
#include <Eigen/Core>

#define PENDULA_TEXT_OF(x) #x
#define PENDULA_TEXT(x) PENDULA_TEXT_OF(x)

const char* const alignments[] = {"pendula-heap-alignment=" PENDULA_TEXT(EIGEN_DEFAULT_ALIGN_BYTES) ";",
                                  "pendula-fixed-alignment=" PENDULA_TEXT(EIGEN_MAX_STATIC_ALIGN_BYTES) ";"};

int main(int argc, char**) {
  return alignments[argc % 2][0];
}
