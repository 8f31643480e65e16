# Packages of Debian, by `cmake --preset package && cmake --build --preset package`: pirt (the program), libpirt1 (the library that it and
# others link), libpirt-dev (headers, the scheduler's archives, CMake package, pkg-config), and pirt-pictures, the modules whose libraries
# bring a hundred others. What they depend on is computed from what is linked. Another build (without PIRT_SHARED) makes no libpirt1.
set(CPACK_GENERATOR DEB)
set(CPACK_PROJECT_CONFIG_FILE ${CMAKE_CURRENT_LIST_DIR}/tools.cmake)
set(CPACK_PACKAGE_NAME pirt)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "pirt maintainers <maintainers@users.noreply.github.com>")
set(CPACK_PACKAGING_INSTALL_PREFIX ${CMAKE_INSTALL_PREFIX})
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS ${CMAKE_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS})
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL program development pictures)
if(PIRT_SHARED)
  list(APPEND CPACK_COMPONENTS_ALL library)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR})
set(same "(= ${PROJECT_VERSION})")

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME pirt)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "pirt-pictures ${same}, pocl-opencl-icd | opencl-icd")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "qemu-user, bash-completion")
set(CPACK_DEBIAN_PROGRAM_DESCRIPTION "measures and schedules robot workloads on several processing units
pirt measures image filters, features, layers of networks, steps of a SLAM,
planning and mapping on every processing unit of a machine, and schedules a
robot's mix of them for latency, throughput or energy, in virtual time or live.")

set(needed libyaml-cpp-dev libfmt-dev libeigen3-dev coinor-libclp-dev libbz2-dev zlib1g-dev pkg-config)  # clp.pc names the last two libraries
if(PIRT_SHARED)
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS "libpirt1 ${same}")  # with what is computed
  set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libpirt1)
  set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
  set(CPACK_DEBIAN_LIBRARY_PACKAGE_RECOMMENDS "pocl-opencl-icd | opencl-icd")
  set(CPACK_DEBIAN_LIBRARY_PACKAGE_SUGGESTS "pirt, pirt-pictures ${same}")
  set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
  file(WRITE ${PROJECT_BINARY_DIR}/triggers "activate-noawait ldconfig\n")
  set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${PROJECT_BINARY_DIR}/triggers)
  set(CPACK_DEBIAN_LIBRARY_DESCRIPTION "runtime library for robots with several processing units
Programs submit tasks and name no device; the library chooses the units by a
profile that pirt has measured.")
  list(PREPEND needed "libpirt1 ${same}")
  set(runtime_link "-lpirt")
else()
  list(APPEND needed ${runtime_packages})
  list(REMOVE_DUPLICATES needed)
  set(runtime_link
    "-lpirt_runtime -lpirt_scheduler -lpirt_characterize -lpirt_workloads -lpirt_profile -lpirt_specs${runtime_link} -lClp -lCoinUtils -lpthread")
endif()
string(REPLACE ";" ", " needed "${needed}")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libpirt-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "${needed}")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "pirt-pictures ${same}")
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION "runtime library for robots with several processing units (development)
Headers, a CMake package (pirt::runtime, pirt::scheduler) and pkg-config
(pirt-runtime, pirt-scheduler); with them a scheduler in virtual time that
links nothing that computes.")

set(CPACK_DEBIAN_PICTURES_PACKAGE_NAME pirt-pictures)
set(CPACK_DEBIAN_PICTURES_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PICTURES_DESCRIPTION "pictures and trained networks for pirt
Modules that pirt loads when it first reads a picture or a trained network:
OpenCV's codecs and its dnn, with all that these link.")

# What every package has.
find_program(GZIP gzip)
set(documents ${CMAKE_CURRENT_LIST_DIR}/copyright)
if(GZIP)
  set(changelog ${PROJECT_BINARY_DIR}/changelog.gz)
  execute_process(COMMAND ${GZIP} -9nc ${CMAKE_CURRENT_LIST_DIR}/changelog OUTPUT_FILE ${changelog} COMMAND_ERROR_IS_FATAL ANY)
  list(APPEND documents ${changelog})
endif()
foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  string(TOUPPER ${component} upper)
  set(package ${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
  install(FILES ${documents} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component})
  if(EXISTS ${CMAKE_CURRENT_LIST_DIR}/${package}.lintian)
    install(FILES ${CMAKE_CURRENT_LIST_DIR}/${package}.lintian DESTINATION ${CMAKE_INSTALL_DATADIR}/lintian/overrides
      RENAME ${package} COMPONENT ${component})
  endif()
endforeach()

# For those who build without CMake.
set(pkgconfig_folder ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
set(to_prefix /x)
cmake_path(RELATIVE_PATH to_prefix BASE_DIRECTORY /x/${pkgconfig_folder})
set(scheduler_link "-lpirt_scheduler -lpirt_profile -lpirt_specs -lClp -lCoinUtils -lpthread")
foreach(library scheduler runtime)
  set(link "${${library}_link}")
  configure_file(${CMAKE_CURRENT_LIST_DIR}/pirt.pc.in ${PROJECT_BINARY_DIR}/pirt-${library}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/pirt-${library}.pc DESTINATION ${pkgconfig_folder} COMPONENT development)
endforeach()
include(CPack)
