#include "tests/server/gateway/certificates.h"

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rsa.h>
#include <openssl/x509v3.h>

#include <atomic>

namespace taclink::server {
namespace {

constexpr long kDay = 24 * 3600;

template <typename Writer>
std::string Pem(const Writer& write) {
  BIO* const bio = BIO_new(BIO_s_mem());
  write(bio);
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio, &data);
  std::string out(data, static_cast<size_t>(size));
  BIO_free(bio);
  return out;
}

std::string CertificatePem(X509* certificate) {
  return Pem([&](BIO* bio) { PEM_write_bio_X509(bio, certificate); });
}

X509* NewCertificate(const std::string& name, EVP_PKEY* key, int days) {
  static std::atomic<long> serial = 1;
  X509* const out = X509_new();
  X509_set_version(out, 2);
  ASN1_INTEGER_set(X509_get_serialNumber(out), serial++);
  X509_gmtime_adj(X509_getm_notBefore(out), -10 * kDay);
  X509_gmtime_adj(X509_getm_notAfter(out), days * kDay);
  X509_set_pubkey(out, key);
  X509_NAME_add_entry_by_txt(X509_get_subject_name(out), "CN", MBSTRING_UTF8,
                             reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
  return out;
}

void Extend(X509* certificate, int kind, const char* value) {
  X509_EXTENSION* const extension = X509V3_EXT_conf_nid(nullptr, nullptr, kind, value);
  X509_add_ext(certificate, extension, -1);
  X509_EXTENSION_free(extension);
}

EVP_PKEY* MakeKey(TestKey kind) {
  switch (kind) {
    case TestKey::kP192:
      return EVP_EC_gen("P-192");
    case TestKey::kRsa1024:
      return EVP_RSA_gen(1024);
    case TestKey::kRsa2048:
      return EVP_RSA_gen(2048);
    case TestKey::kP256:
      break;
  }
  return EVP_EC_gen("P-256");
}

}  // namespace

struct TestAuthority::Keys {
  EVP_PKEY* key = EVP_EC_gen("P-256");
  X509* certificate = NewCertificate("test authority", key, 30);
};

TestAuthority::TestAuthority() : keys_(std::make_unique<Keys>()) {
  X509_set_issuer_name(keys_->certificate, X509_get_subject_name(keys_->certificate));
  Extend(keys_->certificate, NID_basic_constraints, "critical,CA:TRUE");
  Extend(keys_->certificate, NID_key_usage, "critical,keyCertSign,cRLSign");
  X509_sign(keys_->certificate, keys_->key, EVP_sha256());
  pem_ = CertificatePem(keys_->certificate);
}

TestAuthority::~TestAuthority() {
  X509_free(keys_->certificate);
  EVP_PKEY_free(keys_->key);
}

PemPair TestAuthority::Issue(const std::string& name, int days, TestKey kind, TestDigest digest) const {
  EVP_PKEY* const key = MakeKey(kind);
  X509* const certificate = NewCertificate(name, key, days);
  X509_set_issuer_name(certificate, X509_get_subject_name(keys_->certificate));
  Extend(certificate, NID_subject_alt_name, "DNS:localhost,IP:127.0.0.1");
  X509_sign(certificate, keys_->key, digest == TestDigest::kSha1 ? EVP_sha1() : EVP_sha256());
  PemPair out{CertificatePem(certificate), Pem([&](BIO* bio) {
                PEM_write_bio_PrivateKey(bio, key, nullptr, nullptr, 0, nullptr, nullptr);
              })};
  X509_free(certificate);
  EVP_PKEY_free(key);
  return out;
}

}  // namespace taclink::server
