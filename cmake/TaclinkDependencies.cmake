# Everything comes from the packages of Debian 12 or 13 (deploy/packages lists them); what can't be installed beside
# other packages, deploy/install-packages has unpacked here.
file(GLOB unpacked LIST_DIRECTORIES true "${PROJECT_SOURCE_DIR}/build/packages/*/usr")
list(FILTER unpacked EXCLUDE REGEX "\\.new/usr$")  # cut off
list(PREPEND CMAKE_PREFIX_PATH ${unpacked})
find_package(Threads REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE)
find_package(Ceres 2.1 REQUIRED)
find_library(CHOLMOD_LIBRARY cholmod REQUIRED)
find_path(CHOLMOD_INCLUDE_DIR cholmod.h PATH_SUFFIXES suitesparse REQUIRED)
add_library(taclink_cholmod INTERFACE)
# OpenBLAS by name and first: Ceres brings ATLAS in, whose functions have the same names and take 1.5 times as long.
find_library(OPENBLAS_LIBRARY NAMES openblas libopenblas.so.0 REQUIRED)
find_package(OpenMP REQUIRED COMPONENTS CXX)
target_link_options(taclink_cholmod INTERFACE LINKER:--push-state,--no-as-needed,${OPENBLAS_LIBRARY},--pop-state)
target_link_libraries(taclink_cholmod INTERFACE ${CHOLMOD_LIBRARY} ${OpenMP_gomp_LIBRARY})
target_include_directories(taclink_cholmod SYSTEM INTERFACE ${CHOLMOD_INCLUDE_DIR})
find_package(OpenCVLite REQUIRED)
find_package(Protobuf REQUIRED)  # module mode, before gRPC's config looks for its own
find_package(gRPC CONFIG REQUIRED)
find_package(spdlog REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(Boost 1.81 REQUIRED CONFIG)
# By name: another version's headers may be where the compiler looks anyway.
get_target_property(BOOST_INCLUDE_DIR Boost::headers INTERFACE_INCLUDE_DIRECTORIES)
include_directories(SYSTEM BEFORE ${BOOST_INCLUDE_DIR})
find_package(OpenSSL 3 REQUIRED)
find_package(prometheus-cpp CONFIG REQUIRED COMPONENTS core)
find_package(PkgConfig REQUIRED)
pkg_check_modules(TurboJPEG REQUIRED IMPORTED_TARGET libturbojpeg)
pkg_check_modules(Deflate REQUIRED IMPORTED_TARGET libdeflate)
pkg_check_modules(Zstd REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(Lz4 REQUIRED IMPORTED_TARGET liblz4)
find_package(PNG REQUIRED)
find_library(NATS_LIBRARY nats REQUIRED)  # its own config file is broken
if(TACLINK_BUILD_TESTS)
  find_package(GTest REQUIRED)
  include(GoogleTest)
endif()
if(TACLINK_BUILD_BENCHMARKS)
  find_package(benchmark REQUIRED)
endif()
# Not kdl_parser: for the few lines that it spares it brings ROS' logging and node libraries along.
find_library(OROCOS_KDL_LIBRARY orocos-kdl REQUIRED)
find_library(URDFDOM_LIBRARY urdfdom_model REQUIRED)
find_library(CONSOLE_BRIDGE_LIBRARY console_bridge REQUIRED)
find_path(OROCOS_KDL_INCLUDE_DIR kdl/tree.hpp REQUIRED)
# Since Debian 13 in folders of their own.
find_path(URDFDOM_INCLUDE_DIR urdf_parser/urdf_parser.h PATH_SUFFIXES urdfdom REQUIRED)
find_path(URDFDOM_HEADERS_INCLUDE_DIR urdf_model/model.h PATH_SUFFIXES urdfdom_headers REQUIRED)
add_library(taclink_urdf_kdl INTERFACE)
target_link_libraries(taclink_urdf_kdl INTERFACE ${URDFDOM_LIBRARY} ${OROCOS_KDL_LIBRARY} ${CONSOLE_BRIDGE_LIBRARY}
                                                 Eigen3::Eigen)
target_include_directories(taclink_urdf_kdl SYSTEM INTERFACE ${OROCOS_KDL_INCLUDE_DIR} ${URDFDOM_INCLUDE_DIR}
                                                             ${URDFDOM_HEADERS_INCLUDE_DIR})
