# What `cmake --install` puts where, by component:
#
#   development  libraries, headers, the package for find_package, pkg-config's files
#   server       stellated
#   tools        stellate, the command line
#   mpi          stellate-mpi, with STELLATE_MPI; its library and header are of development
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/stellate)
function(stellate_export part)  # PART TARGET=NAME...: NAME as in stellate::NAME
  set(targets)
  set(libraries)  # for pkg-config
  foreach(pair ${ARGN})
    string(REGEX MATCH "^([^=]+)=(.*)$" matched ${pair})
    set_target_properties(${CMAKE_MATCH_1} PROPERTIES EXPORT_NAME ${CMAKE_MATCH_2})
    list(APPEND targets ${CMAKE_MATCH_1})
    get_target_property(type ${CMAKE_MATCH_1} TYPE)
    if(type STREQUAL STATIC_LIBRARY)
      string(APPEND libraries " -l${CMAKE_MATCH_1}")
    endif()
  endforeach()
  install(TARGETS ${targets} EXPORT stellate-${part}
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development
    INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(EXPORT stellate-${part} NAMESPACE stellate:: DESTINATION ${package_folder}
    COMPONENT development)
  configure_file(cmake/stellate-${part}.pc.in stellate-${part}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/stellate-${part}.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
endfunction()

# Where pkg-config's files find the root that they were installed into, wherever it is now.
file(RELATIVE_PATH prefix_from_pkgconfig
  /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
string(REGEX REPLACE "/$" "" prefix_from_pkgconfig "${prefix_from_pkgconfig}")
stellate_export(core stellate_core_face=core stellate_core=core_archive)
install(DIRECTORY ${PROJECT_BINARY_DIR}/include/stellate DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
  COMPONENT development)
if(NOT STELLATE_CORE_ONLY)
  stellate_export(client
    stellate_client=client stellate_mesh=mesh stellate_catalogue=catalogue
    stellate_pipe=pipe stellate_proto=proto)
  set(without)
  if(STELLATE_ORACLES)
    stellate_export(oracles stellate_oracles=oracles)
  else()
    set(without REGEX "/(oracles|oracles/(equations|parametrized|points)).h$" EXCLUDE)
  endif()
  install(DIRECTORY clients/cpp/include/stellate DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
    COMPONENT development PATTERN error.h EXCLUDE PATTERN oracle.h EXCLUDE PATTERN "*.in" EXCLUDE ${without})
  install(DIRECTORY ${PROJECT_BINARY_DIR}/installed/stellate
    ${PROJECT_BINARY_DIR}/clients/cpp/include/stellate
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development)
endif()
configure_package_config_file(cmake/stellateConfig.cmake.in stellateConfig.cmake
  INSTALL_DESTINATION ${package_folder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/stellateConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(
  FILES ${PROJECT_BINARY_DIR}/stellateConfig.cmake ${PROJECT_BINARY_DIR}/stellateConfigVersion.cmake
  DESTINATION ${package_folder} COMPONENT development)

if(STELLATE_PROGRAMS)
  install(TARGETS stellated RUNTIME COMPONENT server)
  install(TARGETS stellate RUNTIME COMPONENT tools)
  if(STELLATE_MPI)
    install(TARGETS stellate-mpi RUNTIME COMPONENT mpi)
    stellate_export(mpi stellate_mpi=mpi stellate_convert=convert stellate_session=session
      stellate_server_base=server_base stellate_text=text)
    install(FILES mpi/include/stellate/mpi.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/stellate
      COMPONENT development)
  endif()
endif()
