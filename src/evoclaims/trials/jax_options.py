"""The options of jax under which trials are defined: any other value would change their numbers, or forbid them.

jax has more than a hundred (`JAX_…` variables, `jax.config.update`, context managers), and each release adds some.
Those that change nothing but messages, files and hardware are free. All others, also unknown ones, keep their default.
"""

from __future__ import annotations

import functools
import json
import os
import subprocess
import sys
from collections.abc import Iterable, Mapping
from typing import Any, Final

import jax

from evoclaims.core.errors import UserError

_MESSAGES: Final = """
    jax_captured_constants_report_frames jax_captured_constants_warn_bytes jax_compiler_detailed_logging_min_ops
    jax_debug_log_modules jax_distributed_debug jax_dump_ir_modes jax_dump_ir_to jax_explain_cache_misses
    jax_hlo_source_file_canonicalization_regex jax_include_debug_info_in_dumps
    jax_include_full_tracebacks_in_locations jax_log_checkpoint_residuals jax_log_compiles jax_logging_level
    jax_mosaic_unzip_debug_locations jax_pallas_verbose_errors jax_pprint_use_color jax_send_traceback_to_runtime
    jax_source_url_schema jax_traceback_filtering jax_traceback_in_locations_limit
    jax_tracer_error_num_traceback_frames
"""
_CACHES: Final = """
    jax_compilation_cache_check_contents jax_compilation_cache_dir jax_compilation_cache_expect_pgle
    jax_compilation_cache_include_metadata_in_key jax_compilation_cache_max_size jax_enable_compilation_cache
    jax_persistent_cache_enable_xla_caches jax_persistent_cache_min_compile_time_secs
    jax_persistent_cache_min_entry_size_bytes jax_raise_persistent_cache_errors
    jax_remove_custom_partitioning_ptr_from_cache_key
"""
_HARDWARE_AND_HOSTS: Final = """
    jax_backend_target jax_check_proxy_envs jax_cpu_collectives_implementation
    jax_cpu_get_global_topology_timeout_minutes jax_cpu_get_local_topology_timeout_minutes
    jax_cross_host_transfer_socket_address jax_cross_host_transfer_timeout_seconds
    jax_cross_host_transfer_transfer_size jax_cross_host_transport_addresses jax_cuda_visible_devices
    jax_distributed_verify_secure_credentials jax_enable_preemption_service jax_enable_recoverability
    jax_force_dcn_cross_host_transfers jax_mtls_ca_file jax_mtls_cert_file jax_mtls_key_file
    jax_mtls_peer_uri_prefix jax_num_cpu_devices jax_oneapi_visible_devices jax_platform_name jax_platforms
    jax_rocm_visible_devices jax_share_binary_between_hosts jax_share_binary_between_hosts_timeout_ms
    jax_sort_devices_by_process_index jax_xla_backend
"""
_STRICT_TYPES: Final = "jax_numpy_dtype_promotion jax_numpy_rank_promotion"
"""They refuse programs, and change none; code of other libraries is traced without them (`core.foreign`)."""
_JAXS_OWN_TESTS: Final = """
    exclude_test_targets jax_num_generated_cases jax_skip_slow_tests jax_test_dut jax_test_num_threads
    jax_test_with_persistent_compilation_cache max_cases_sampling_retries test_targets
"""

FREE: Final = frozenset((_MESSAGES + _CACHES + _HARDWARE_AND_HOSTS + _STRICT_TYPES + _JAXS_OWN_TESTS).split())
"""Options with any value of which trials have the same digests."""

DEFAULTS: Final[Mapping[str, str]] = {
    name: value
    for value, names in {
        "False": """
            check_vma eager_constant_folding jax2tf_associative_scan_reductions jax_accurate_erf_inv
            jax_bcoo_cusparse_lowering jax_check_static_indices jax_check_tracer_leaks jax_custom_jvp3 jax_custom_vjp3
            jax_debug_infs jax_debug_key_reuse jax_debug_leaked_clients_on_clear_backends jax_debug_nans
            jax_disable_bwd_checks jax_disable_jit jax_disable_most_optimizations jax_disable_vmap_shmap_error
            jax_disallow_mesh_context_manager jax_enable_checks jax_enable_custom_prng jax_enable_pgle jax_enable_x64
            jax_experimental_unsafe_xla_runtime_errors jax_export_deserialize_expired_versions
            jax_export_ignore_forward_compatibility jax_high_dynamic_range_gumbel jax_mosaic_allow_hlo
            jax_no_execution jax_no_tracing jax_pallas_enable_debug_checks jax_pallas_poison_buffers
            jax_ragged_dot_use_gpu_pallas_triton_lowering jax_refs_to_pins jax_remat3 jax_remat_barrier_no_cotangents
            jax_remove_size_one_mesh_axis_from_type jax_scan3 jax_softmax_custom_jvp jax_thread_guard
            jax_threefry_gpu_kernel_lowering jax_use_cpp_shard_args jax_use_emit_pipeline_primitive
            jax_use_simplified_jaxpr_constants
        """,
        "True": """
            jax2tf_default_native_serialization jax_allow_f16_reductions jax_auto_pcast jax_compiler_enable_remat_pass
            jax_cpu_enable_async_dispatch jax_mutable_array_checks jax_pallas_use_mosaic_gpu
            jax_ragged_dot_use_ragged_dot_instruction jax_raise_on_ppermute_sort_diff jax_threefry_partitionable
            jax_use_direct_linearize jax_use_rgv3 jax_use_shardy_partitioner
        """,
        "None": """
            jax_array_garbage_collection_guard jax_default_device jax_default_matmul_precision
            jax_pjrt_client_create_options jax_transfer_guard jax_transfer_guard_device_to_device
            jax_transfer_guard_device_to_host jax_transfer_guard_host_to_device jax_use_hlo_logistic_lowering
        """,
        "ignore": """
            jax_error_checking_behavior_divide jax_error_checking_behavior_nan jax_error_checking_behavior_oob
        """,
        "0": "jax_random_seed_offset jax_serialization_version jax_xla_profile_version mock_num_gpu_processes",
        "0.0": "jax_exec_time_optimization_effort jax_memory_fitting_effort",
        "10": "jax_export_calling_convention_version",
        "25": "jax_pallas_auto_assign_collective_ids_limit",
        "3": "jax_pgle_profiling_runs",
        "32": "jax_embedded_constants_max_bytes",
        "90": "jax_pgle_aggregation_percentile",
        "ALLOW": "jax_legacy_prng_key",
        "O2": "jax_memory_fitting_level",
        "UNKNOWN": "jax_optimization_level",
        "WARN": "jax_explicit_x64_dtypes",
        "auto": "jax_use_magma",
        "no": "jax_pallas_auto_assign_collective_ids",
        "threefry2x32": "jax_default_prng_impl",
        "": "jax_mock_gpu_topology",
    }.items()
    for name in names.split()
}
"""Values of the others by default, in jax 0.10.2 and in 0.12.0; a release that differs is asked (see `_of_release`)."""

_NEUTRAL: Final = ("False", "None", "0", "0.0", "")
"""Values that an option has while it does nothing: a new one is asked for only if its value is another."""


def refuse_changed() -> None:
    """Check that no option of jax has a value with which trials have other numbers, or cannot run.

    Raises:
        UserError: with the names of the options that have one, and of their environment variables.
    """
    values = {name: _plain(value) for name, value in jax.config.values.items() if name not in FREE}
    suspects = [
        name for name, value in values.items() if value not in ((DEFAULTS[name],) if name in DEFAULTS else _NEUTRAL)
    ]
    if not suspects:
        return
    usual = _of_release()
    changed = [name for name in suspects if values[name] != usual.get(name, DEFAULTS.get(name))]
    if changed:
        usual = {**DEFAULTS, **usual}
        listed = ", ".join(f"{name} is {values[name]} (default: {usual.get(name, 'another')})" for name in changed)
        raise UserError(
            f"These settings of jax change or forbid trials: {listed}. Trials are defined with jax's "
            f"defaults. {_how_to_unset(changed)}"
        )


def _plain(value: Any) -> str:
    """Return an option's value as a text; of an enumeration, its name."""
    return str(getattr(value, "name", value))


def _how_to_unset(names: Iterable[str]) -> str:
    """Return what to do about changed options: variables are named, and else the program has set them."""
    variables = [name.upper() for name in names if name.upper() in os.environ]
    if variables:
        return f"Unset {' and '.join(variables)}."
    return (
        "Remove jax.config.update(...), or the context manager, that sets this: a training loop may set it for itself."
    )


@functools.cache
def _of_release() -> Mapping[str, str]:
    """Return the defaults of the installed jax, from a process without any JAX_ variable; empty if that fails."""
    code = "import jax, json; print(json.dumps({n: str(getattr(v, 'name', v)) for n, v in jax.config.values.items()}))"
    environment = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
    try:
        done = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, stdin=subprocess.DEVNULL, check=True
        )
        found: Mapping[str, str] = json.loads(done.stdout)
    except (OSError, subprocess.SubprocessError, ValueError):
        return {}
    return found
